"""Many drives: how they are found, where their files are, and who replays them."""
