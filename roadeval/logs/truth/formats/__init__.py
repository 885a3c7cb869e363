"""Formats of the files of annotation tools; each module here defines one as ``FORMAT``."""
