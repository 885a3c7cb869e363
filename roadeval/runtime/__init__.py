"""Threads, files, memory and text from outside. This room knows nothing of roads and cameras."""
