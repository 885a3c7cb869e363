"""Message encodings; each module here lists its own in ``ENCODINGS``."""
