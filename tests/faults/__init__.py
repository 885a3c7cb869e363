"""Runs that are killed, disks that are full, and runs that write the same outputs at once."""
