"""The commands: each file here is one command, and its function has the name of the file."""
