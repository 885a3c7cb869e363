"""Errors of networks."""

from roadeval.errors import RoadevalError


class NetworkError(RoadevalError):
    """A network that cannot be used: which file, why, and what to do."""
