"""Errors of finding and fetching drives."""

from __future__ import annotations

from roadeval.errors import RoadevalError


class FleetError(RoadevalError):
    """Drives that cannot be found or fetched, or a manifest that cannot be used."""
