"""Counts and metrics against the truth (Eq. 24-29), regions, intervals and comparisons."""
