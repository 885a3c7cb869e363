"""Stages and chains: pure functions on arrays. `paper` is what the paper has, `beyond` the rest."""
