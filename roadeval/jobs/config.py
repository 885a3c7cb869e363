"""The whole effective configuration, to read and to edit."""

from __future__ import annotations

from roadeval.config import RunConfig, documented


def config_toml(config: RunConfig | None = None) -> str:
    """Return a configuration as TOML: every setting with its meaning, range and value.

    Parameters
    ----------
    config
        The configuration; the defaults of ``roadeval replay`` otherwise. The text holds every
        setting, and can be edited and given to `roadeval.load_config`.

    Examples
    --------
    >>> import roadeval
    >>> text = roadeval.config_toml(roadeval.configure({"preset": "gated"}))
    >>> text.startswith('preset = "gated"')
    True
    """
    return documented(config or RunConfig())
