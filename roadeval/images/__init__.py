"""Image files: from their bytes to arrays. A damaged file is an error, never half a picture.

No other room decodes them, so that camera, truth, masks and the pictures of a recording are read,
checked and refused alike.
"""

from roadeval.images.decoding import (
    eight_bits,
    palette_indices,
    size_of,
    to_labels,
    to_png,
    to_rgb,
    without_colours,
)
from roadeval.images.formats import (
    MAX_PIXELS,
    DamagedImageError,
    ImageError,
    ImageFormat,
    Limits,
    format_of,
)

__all__ = [
    "MAX_PIXELS",
    "DamagedImageError",
    "ImageError",
    "ImageFormat",
    "Limits",
    "eight_bits",
    "format_of",
    "palette_indices",
    "size_of",
    "to_labels",
    "to_png",
    "to_rgb",
    "without_colours",
]
