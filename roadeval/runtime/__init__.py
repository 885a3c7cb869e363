"""The machine: threads, files, memory, text from elsewhere. Knows nothing of the domain."""
