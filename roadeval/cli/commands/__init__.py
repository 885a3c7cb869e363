"""The commands: each file here is one, whose function has the file's name."""
