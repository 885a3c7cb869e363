"""Codecs between a layer's array and its bytes in the recording: one a kind of layer.

=========  ==========================  ============================================================
kind       in the file                 what comes back
=========  ==========================  ============================================================
mask       PNG with a palette          the same array
labels     raw class ids, LZ4          the same array (class names show under the mouse, at a
                                       byte a pixel in the viewer's memory and in ours)
scalar     grey PNG, coloured by the   nearest of 256 levels over the range; if not exact, 52
           viewer                      levels at half resolution
rgb        PNG                         the same image; if not exact, a JPEG at half resolution
=========  ==========================  ============================================================

What never changes (colours, class names, ranges) is a codec's ``style``, logged once; a frame
adds only its payload. Both need Rerun, which is imported there: who decodes does without.
"""

from __future__ import annotations

from roadeval.data import LayerKind, LayerSpec
from roadeval.recording.codecs.codec import Codec
from roadeval.recording.codecs.masks import LabelCodec, MaskCodec
from roadeval.recording.codecs.pictures import CameraCodec, ImageCodec, ScalarCodec
from roadeval.recording.layout import CAMERA, Layout


def codecs_of(layout: Layout) -> dict[str, Codec]:
    """Return the codec of every image, by its entity path."""
    width, height = layout.width, layout.height
    codecs: dict[str, Codec] = {CAMERA: CameraCodec(width, height)}
    return codecs | {path: codec(spec, width, height) for path, spec in layout.images()}


def codec(spec: LayerSpec, width: int, height: int) -> Codec:
    """Return the codec of a layer of ``width`` x ``height`` pixels."""
    match spec.kind:
        case LayerKind.MASK:
            return MaskCodec(spec, width, height)
        case LayerKind.LABELS:
            return LabelCodec(spec, width, height)
        case LayerKind.SCALAR:
            return ScalarCodec(spec, width, height)
        case LayerKind.RGB:
            return ImageCodec(width, height, exact=spec.exact)
