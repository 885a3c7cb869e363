"""The harnesses, one file each; see `tests.fuzz.harness`."""
