"""Stages and chains: pure functions on arrays. `paper` has the paper's stages, `beyond` all others."""
