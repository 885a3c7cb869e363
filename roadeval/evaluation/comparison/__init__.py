"""The comparison of results: what changed on the same frames, and the limits that it must keep."""
