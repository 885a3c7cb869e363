"""The terminal's screens of 80 columns, one file a command."""
