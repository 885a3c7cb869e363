"""Stages and chains: pure functions on arrays, of the paper in `paper`, all others in `beyond`."""
