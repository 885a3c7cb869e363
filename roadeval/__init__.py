"""Logged-replay evaluation and visualisation of road recognition."""

from roadeval.version import VERSION as __version__

__all__ = ["__version__"]
