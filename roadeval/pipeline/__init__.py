"""Stages and chains: pure functions on arrays. The paper's are in `paper`, others in `beyond`."""
