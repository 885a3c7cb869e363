"""The terminal: thin commands, progress, messages, exit codes."""
