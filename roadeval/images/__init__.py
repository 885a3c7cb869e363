"""Image files: from their bytes to arrays. A damaged file is an error, never half a picture.

No other room decodes them, so that camera, truth, masks and the pictures of a recording are read,
checked and refused alike. Names are imported when they are first used: a command that reads
settings needs little else.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.images.decoding import (
        ORIENTATIONS,
        eight_bits,
        orientation_of,
        palette_indices,
        png_of,
        size_of,
        to_labels,
        to_rgb,
        upright,
        without_colours,
    )
    from roadeval.images.formats import (
        MAX_PIXELS,
        ImageError,
        ImageFormat,
        Limits,
        format_of,
    )

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
