"""Errors of reading image files; each message completes "frame 7: ..."."""

from __future__ import annotations


class ImageError(ValueError):
    """An image that cannot be read, or is not read because it is too large."""


class DamagedImageError(ImageError):
    """An image file that is damaged; `Limits.keep_damaged` reads what is left of it."""
