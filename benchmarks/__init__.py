"""How fast roadeval is, against what, on the same frames in one run: ``python -m benchmarks``."""
