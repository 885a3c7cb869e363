"""The public functions behind the commands."""
