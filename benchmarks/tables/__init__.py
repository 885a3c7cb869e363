"""The tables in README.md, PRESETS.md and the site, and what they are made from."""
