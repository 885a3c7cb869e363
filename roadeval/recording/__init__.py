"""Rerun recordings: written during a replay, read back without the log. Nobody else knows Rerun."""
