"""Codecs between a layer's array and its bytes in the recording, one for each kind of layer.

=========  ==========================  ============================================================
kind       in the file                 what is read back
=========  ==========================  ============================================================
mask       PNG with a palette          the same array
labels     raw class ids, LZ4          the same array (the viewer names the class under the mouse;
                                       a byte a pixel in its memory and in ours)
scalar     grey PNG, coloured by the   the nearest of 256 levels over the range, of large images
           viewer; if photographic,    reduced; if not exact, 52 levels, reduced; if photographic,
           grey JPEG                   within 3 of 256 levels on average, reduced as the others
rgb        PNG                         the same image; if not exact, a JPEG, reduced
=========  ==========================  ============================================================

A reduced image holds the means of blocks of pixels, two by two or larger, so that at most `COLUMNS`
columns are left. It is only looked at: a full map of 1920x1200 pixels takes twice the bytes of the
camera's JPEG. An image is large if it has more than twice as many columns.

A map's JPEG rounds all frequencies to multiples of the same step, which OpenCV cannot set. With the
same mean error it takes three quarters of the bytes of the usual tables, which are made for eyes.
Multiples of 12 leave a mean error of at most 2.8 levels, even on pure noise. Blocks of one level,
such as areas beyond an end of the range, come back unchanged.

Only ``columns`` imports Rerun: decoding does not need it.

A label image has 1, 2, 4 or 8 bits a pixel: the value of a pixel is its index, the palette only
colours it. A binary mask of a real frame takes a quarter of the size of its raw bytes after LZ4.
For files of the same size ISA-L takes a half to two thirds of zlib-ng's time and a third of zlib's;
Pillow and OpenCV take longer still.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, sections 5, 9 and 11.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import cv2
import numpy as np
import numpy.typing as npt
from isal import igzip_lib
from isal.isal_zlib import crc32

from roadeval.data import LayerKind, LayerSpec, Packed
from roadeval.data.colours import ColourWithOpacity
from roadeval.images.decoding import palette_indices, to_labels, to_rgb
from roadeval.images.formats import MAX_PIXELS, Limits
from roadeval.kernels import KERNELS
from roadeval.recording.layout import CAMERA, DISTURBED, GROUND, Layout

Array = npt.NDArray[Any]
JPEG_QUALITY: Final = 90
"""Quality of camera images that the log does not hold as JPEG or PNG."""
REDUCED_QUALITY: Final = 80
"""Quality of colour images that need not be exact, which are also reduced."""
STEPS: Final = [8] + [12] * 63
"""Steps of the 8x8 frequencies of a map's JPEG; the first, 8, is one level of a block's mean."""

COLUMNS: Final = 400
"""Greatest number of columns of a reduced image."""

_FIFTHS: Final = (np.rint(np.arange(256) / 5) * 5).astype(np.uint8)
"""Every level rounded to a multiple of five: fewer levels take fewer bytes."""


def codecs_of(layout: Layout) -> dict[str, Codec]:
    """Return the codec of every image, by its entity path."""
    width, height = layout.width, layout.height
    codecs: dict[str, Codec] = {CAMERA: Codec(width, height)}
    codecs |= {path: codec(spec, width, height) for path, spec in layout.images()}
    for name in layout.disturbed:
        codecs[f"{DISTURBED}/{name}{CAMERA}"] = Codec(width, height)
    if (plan := layout.plan()) is not None:
        rows, columns = plan.cells.shape
        codecs[GROUND] = Codec(columns, rows)
        codecs |= {path: codec(spec, columns, rows) for path, spec in layout.from_above()}
    return codecs


def codec(spec: LayerSpec, width: int, height: int) -> Codec:
    """Return the codec of a layer of ``width`` x ``height`` pixels."""
    kinds = {LayerKind.MASK: MaskCodec, LayerKind.LABELS: LabelCodec, LayerKind.SCALAR: ScalarCodec}
    return kinds.get(spec.kind, ImageCodec)(width, height, spec)


_CAMERA: Final = LayerSpec("camera", LayerKind.RGB, "Camera")


@dataclass(frozen=True)
class Codec:
    """Encodes and decodes images of one kind.

    This class itself is for the camera's images, JPEG or PNG as the log has them.
    """

    width: int
    height: int
    spec: LayerSpec = _CAMERA
    component: ClassVar = "EncodedImage:blob"
    """The archetype and its component that hold the bytes."""

    def encode(self, array: Any) -> bytes:
        """Return the bytes of a frame's array, here of ``(H, W, 3)`` uint8 RGB as a JPEG file."""
        return _jpeg(array, JPEG_QUALITY)

    def fitted(self, array: Any) -> Array:
        """Return the array of a frame of another size, resized to the recording's size."""
        pixels = array.pixels() if isinstance(array, Packed) else array
        method = cv2.INTER_LINEAR if pixels.ndim == 3 else cv2.INTER_NEAREST
        return np.asarray(cv2.resize(pixels, (self.width, self.height), interpolation=method))

    def columns(self, payloads: list[bytes]) -> Any:
        """Return the viewer's columns of the bytes of many frames."""
        import rerun as rr

        archetype, _, component = self.component.partition(":")
        return getattr(rr, archetype).columns(**{component: payloads})

    def decode(self, payload: bytes) -> Array:
        """Return the array, here ``(H, W, 3)`` uint8 RGB; a ValueError if the bytes are damaged."""
        return to_rgb(payload, limits_for(self.width, self.height))


class ImageCodec(Codec):
    """A colour image: a PNG, or a small JPEG."""

    def encode(self, array: Array) -> bytes:
        """Return ``(H, W, 3)`` uint8 RGB as a file."""
        return encode_levels(array) if self.spec.exact else _jpeg(_reduce(array), REDUCED_QUALITY)

    def decode(self, payload: bytes) -> Array:
        """Return ``(H, W, 3)`` uint8 RGB at full resolution."""
        return np.asarray(cv2.resize(super().decode(payload), (self.width, self.height)))


class MaskCodec(Codec):
    """A mask: a PNG of a few bits a pixel whose palette holds the classes' colours."""

    @cached_property
    def _tables(self) -> tuple[Array, Array]:
        """The classes' places in the palette by their values, and the reverse, ``(256,)`` each."""
        places, values = np.zeros((2, 256), np.uint8)
        for place, label in enumerate(self.spec.classes):
            places[label.value], values[place] = place, label.value
        return places, values

    def encode(self, array: npt.NDArray[np.uint8] | Packed) -> bytes:
        """Return a PNG file of ``(H, W)`` uint8 class values, or of the bits of two classes."""
        if not isinstance(array, Packed):
            array = np.asarray(cv2.LUT(array, self._tables[0]), np.uint8)
        return encode_labels(array, [c.rgba for c in self.spec.classes])

    def decode(self, payload: bytes) -> Array:
        """Return the same array."""
        labels = palette_indices(payload, limits_for(self.width, self.height))
        return np.asarray(cv2.LUT(labels, self._tables[1]))


class LabelCodec(Codec):
    """A label image: raw bytes, so that the viewer can name the class under the mouse."""

    component = "SegmentationImage:buffer"

    def encode(self, array: Array) -> bytes:
        """Return the bytes of ``(H, W)`` uint8."""
        return array.tobytes()

    def decode(self, payload: bytes) -> Array:
        """Return the same array."""
        return np.frombuffer(payload, np.uint8).reshape(self.height, self.width)


class ScalarCodec(Codec):
    """A map of numbers: a grey image whose levels span the range, coloured by the viewer."""

    component = "EncodedDepthImage:blob"

    def encode(self, array: Array) -> bytes:
        """Return an image file of ``(H, W)`` float32, or of uint8 codes that span the range."""
        if not self.spec.exact or self.width > 2 * COLUMNS:
            array = _reduce(array)
        if array.dtype != np.uint8:
            low, high = self.spec.value_range
            scaled = (array - np.float32(low)) * np.float32(255 / (high - low))
            array = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
        if self.spec.photographic:
            from PIL import Image

            file = io.BytesIO()
            Image.fromarray(array).save(file, "JPEG", qtables=[STEPS])
            return file.getvalue()
        if not self.spec.exact:
            array = np.asarray(cv2.LUT(array, _FIFTHS), np.uint8)
        return encode_levels(array)

    def decode(self, payload: bytes) -> Array:
        """Return ``(H, W)`` float32 in the layer's own unit, at full resolution."""
        codes = to_labels(payload, limits_for(self.width, self.height))
        low, high = self.spec.value_range
        values: Array = codes * np.float32((high - low) / 255) + np.float32(low)
        return np.asarray(cv2.resize(values, (self.width, self.height)))


def _reduce(array: Array) -> Array:
    height, width = array.shape[:2]
    block = max(2, -(-width // COLUMNS))
    size = -(-width // block), -(-height // block)
    return cv2.resize(array, size, interpolation=cv2.INTER_AREA)


def _jpeg(rgb: Array, quality: int) -> bytes:
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def limits_for(width: int, height: int) -> Limits:
    """Return the limits on an image's size, which always allow the recording's own size."""
    return Limits(max(MAX_PIXELS, width * height))


Bytes = npt.NDArray[np.uint8]

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_GREY, _COLOUR, _PALETTE = 0, 2, 3
"""The kinds of pixels in a file's header."""

_WINDOW_BITS: Final = 9
"""Base-2 logarithm of the bytes that are searched for repetitions: on masks and on noise, a
reference further back costs more bits than it saves."""


def encode_labels(labels: Bytes | Packed, palette: Sequence[ColourWithOpacity]) -> bytes:
    """Encode ``(H, W)`` uint8 labels, each below ``len(palette)``, as a PNG file.

    Labels of two classes may be packed, or of another type: all but 0 are the second class.
    """
    bits = next(bits for bits in (1, 2, 4, 8) if len(palette) <= 1 << bits)
    pixels = labels.pixels() if isinstance(labels, Packed) else labels
    if bits == 1:
        lines = np.insert(np.packbits(pixels, axis=1), 0, np.uint8(0), axis=1)
    else:
        lines = KERNELS.label_rows(np.ascontiguousarray(pixels, np.uint8), bits)
    colours = bytes(value for *rgb, _ in palette for value in rgb)
    opacity = bytes(alpha for *_, alpha in palette)
    chunks = _chunk(b"PLTE", colours), _chunk(b"tRNS", opacity)
    return _file(labels.shape, bits, _PALETTE, chunks, lines)


def encode_levels(levels: Bytes) -> bytes:
    """Encode ``(H, W)`` uint8 grey levels, or ``(H, W, 3)`` uint8 RGB, as a PNG file."""
    height, width, *channels = levels.shape
    step = channels[0] if channels else 1
    lines = KERNELS.filter_rows(np.ascontiguousarray(levels.reshape(height, -1)), step)
    return _file((height, width), 8, _COLOUR if channels else _GREY, (), lines)


def compress(lines: Bytes) -> bytes:
    """Compress ``(H, 1 + B)`` uint8 rows, each after its filter's number, in zlib's format."""
    return igzip_lib.compress(lines.data, 1, flag=igzip_lib.COMP_ZLIB, hist_bits=_WINDOW_BITS)


def _file(
    shape: tuple[int, int], bits: int, kind: int, chunks: Sequence[bytes], lines: Bytes
) -> bytes:
    height, width = shape
    head = _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0))
    pixels = _chunk(b"IDAT", compress(lines))
    return b"".join((_SIGNATURE, head, *chunks, pixels, _chunk(b"IEND", b"")))


def _chunk(name: bytes, body: bytes) -> bytes:
    head = struct.pack(">I", len(body)) + name
    return head + body + struct.pack(">I", crc32(body, crc32(name)))
