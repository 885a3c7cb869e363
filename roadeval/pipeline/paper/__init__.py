"""The paper's pipeline, one file a phase."""
