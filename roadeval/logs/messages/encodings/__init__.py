"""Message encodings, found by this folder: ``ENCODINGS`` of each file in it."""
