"""The tables of README.md and benchmarks/PRESETS.md, and what they are made from."""
