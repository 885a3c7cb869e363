"""Runs: replays of one log or many, and the training of models."""
