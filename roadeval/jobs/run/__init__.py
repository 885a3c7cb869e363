"""Runs: a log or many replayed, and models trained."""
