"""The machine: threads, processes, files and memory. Knows nothing of the domain."""
