"""The machine: threads, files and memory. Knows nothing of the domain."""
