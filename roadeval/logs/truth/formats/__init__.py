"""Formats of the files of annotation tools; each module here lists its own in ``FORMATS``."""
