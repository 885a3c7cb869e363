"""The tables in README.md, PRESETS.md and the site, and their numbers."""
