"""Writing a recording while frames arrive."""
