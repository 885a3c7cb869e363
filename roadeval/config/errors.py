"""Errors of a configuration."""

from roadeval.errors import RoadevalError


class ConfigError(RoadevalError):
    """A setting that cannot be used: which file, which key, and what is allowed."""
