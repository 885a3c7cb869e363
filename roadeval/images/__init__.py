"""Image files: from their bytes to arrays. A damaged file is an error, never half a picture.

No other room decodes them, so that camera, truth, masks and the pictures of a recording are read,
checked and refused alike.
"""

from roadeval.images.decoding import palette_indices, size_of, to_labels, to_png, to_rgb
from roadeval.images.errors import DamagedImageError, ImageError
from roadeval.images.formats import ImageFormat, format_of
from roadeval.images.limits import MAX_PIXELS, Limits

__all__ = [
    "MAX_PIXELS",
    "DamagedImageError",
    "ImageError",
    "ImageFormat",
    "Limits",
    "format_of",
    "palette_indices",
    "size_of",
    "to_labels",
    "to_png",
    "to_rgb",
]
