"""Configurations: a run's and its variants', presets, and TOML both ways."""
