"""The public functions, one file a command."""
