"""The paper's pipeline: pure functions on arrays, one file a phase."""
