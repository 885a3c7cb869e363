"""Codecs between a layer's array and its bytes in the recording: one a kind of layer.

=========  ==========================  ============================================================
kind       in the file                 what is read back
=========  ==========================  ============================================================
mask       PNG with a palette          the same array
labels     raw class ids, LZ4          the same array (the viewer names the class under the mouse;
                                       a byte a pixel in its memory and in ours)
scalar     grey PNG, coloured by the   the nearest of 256 levels over the range; if not exact, 52
           viewer                      levels at half resolution
rgb        PNG                         the same image; if not exact, a JPEG at half resolution
=========  ==========================  ============================================================

What is the same on all frames (colours, class names, ranges) is a codec's ``style``, logged once.
Rerun is imported by ``style`` and ``columns`` alone: decoding does not need it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from roadeval import images
from roadeval.data import LayerKind, LayerSpec, Packed
from roadeval.images import MAX_PIXELS, Limits
from roadeval.recording import png
from roadeval.recording.layout import CAMERA, Layout

Array = npt.NDArray[Any]
JPEG_QUALITY: Final = 90
"""Of camera images that the log does not hold as JPEG or PNG, and of layers that need not be exact,
which are also halved in size."""

_FIFTHS: Final = (np.rint(np.arange(256) / 5) * 5).astype(np.uint8)
"""Every level rounded to a multiple of five: fewer levels take fewer bytes."""


class Codec(Protocol):
    """Encodes and decodes one kind of layer, and tells the viewer how to show it."""

    component: str
    """Name of the component that holds the bytes."""

    def style(self) -> Sequence[Any]:
        """Return the archetypes that are logged once for the entity."""

    def encode(self, array: Any) -> bytes:
        """Return the bytes of a frame's array; a mask may be packed."""

    def columns(self, payloads: list[bytes]) -> Any:
        """Return the viewer's columns of the bytes of many frames."""

    def decode(self, payload: bytes) -> Array:
        """Return the array; a ValueError if the bytes are damaged or of another kind."""


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


@dataclass(frozen=True)
class MaskCodec:
    """A mask: a PNG of a few bits a pixel whose palette holds the classes' colours."""

    spec: LayerSpec
    width: int
    height: int
    component = "EncodedImage:blob"

    @cached_property
    def _values(self) -> Array:
        """The classes' values by their place in the palette."""
        return np.array([c.value for c in self.spec.classes], np.uint8)

    @cached_property
    def _places(self) -> Array | None:
        """The classes' places in the palette by their values; None if they are the same."""
        if (self._values == np.arange(len(self._values))).all():
            return None
        places = np.zeros(256, np.uint8)
        places[self._values] = np.arange(len(self._values))
        return places

    def style(self) -> Sequence[Any]:
        """Draw it above the camera's image."""
        import rerun as rr

        return [rr.EncodedImage.from_fields(media_type="image/png", draw_order=10)]

    def encode(self, array: npt.NDArray[np.uint8] | Packed) -> bytes:
        """Return a PNG file of ``(H, W)`` uint8 class values, or of the bits of two classes."""
        if self._places is not None and not isinstance(array, Packed):
            array = np.asarray(cv2.LUT(array, self._places), np.uint8)
        return png.encode_labels(array, [c.rgba for c in self.spec.classes])

    def columns(self, payloads: list[bytes]) -> Any:
        """Return columns of encoded images."""
        import rerun as rr

        return rr.EncodedImage.columns(blob=payloads)

    def decode(self, payload: bytes) -> Array:
        """Return the same array."""
        labels = images.palette_indices(payload, limits_for(self.width, self.height))
        return labels if self._places is None else np.asarray(self._values[labels])


@dataclass(frozen=True)
class LabelCodec:
    """A label image: raw bytes, so that the viewer can name the class under the mouse."""

    spec: LayerSpec
    width: int
    height: int
    component = "SegmentationImage:buffer"

    def style(self) -> Sequence[Any]:
        """Return the classes' names and colours, and every frame's format."""
        import rerun as rr

        classes = [rr.AnnotationInfo(c.value, c.name, c.rgba) for c in self.spec.classes]
        form = rr.components.ImageFormat(
            self.width,
            self.height,
            color_model=rr.ColorModel.L,
            channel_datatype=rr.ChannelDatatype.U8,
        )
        return [
            rr.AnnotationContext(classes),
            rr.SegmentationImage.from_fields(format=form, opacity=1.0, draw_order=10),
        ]

    def encode(self, array: Array) -> bytes:
        """Return the bytes of ``(H, W)`` uint8."""
        return array.tobytes()

    def columns(self, payloads: list[bytes]) -> Any:
        """Return columns of segmentation images."""
        import rerun as rr

        return rr.SegmentationImage.columns(buffer=payloads)

    def decode(self, payload: bytes) -> Array:
        """Return the same array."""
        return np.frombuffer(payload, np.uint8).reshape(self.height, self.width)


@dataclass(frozen=True)
class ScalarCodec:
    """A map of numbers: a grey PNG whose levels span the range, coloured by the viewer."""

    spec: LayerSpec
    width: int
    height: int
    component = "EncodedDepthImage:blob"

    def style(self) -> Sequence[Any]:
        """Return the colour map; to the viewer grey levels are fractions, whatever the unit."""
        import rerun as rr

        return [
            rr.EncodedDepthImage.from_fields(
                media_type="image/png",
                meter=1.0,
                depth_range=(0.0, 1.0),
                colormap=rr.components.Colormap.Viridis,
            )
        ]

    def encode(self, array: Array) -> bytes:
        """Return a PNG file of ``(H, W)`` float32, or of uint8 codes that span the range."""
        if not self.spec.exact:
            array = _halve(array)
        if array.dtype != np.uint8:
            low, high = self.spec.value_range
            scaled = (array - np.float32(low)) * np.float32(255 / (high - low))
            array = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
        if self.spec.exact:
            return png.encode_levels(array)
        return png.encode_levels(np.asarray(cv2.LUT(array, _FIFTHS), np.uint8))

    def columns(self, payloads: list[bytes]) -> Any:
        """Return columns of encoded depth images."""
        import rerun as rr

        return rr.EncodedDepthImage.columns(blob=payloads)

    def decode(self, payload: bytes) -> Array:
        """Return ``(H, W)`` float32 in the layer's own unit, at full resolution."""
        codes = images.to_labels(payload, limits_for(self.width, self.height))
        low, high = self.spec.value_range
        values: Array = codes * np.float32((high - low) / 255) + np.float32(low)
        return _restore(values, self.width, self.height)


@dataclass(frozen=True)
class CameraCodec:
    """The camera's image: JPEG or PNG, as the log has it."""

    width: int
    height: int
    component = "EncodedImage:blob"

    def style(self) -> Sequence[Any]:
        """Draw it below every mask."""
        import rerun as rr

        return [rr.EncodedImage.from_fields(draw_order=-10)]

    def encode(self, array: Array) -> bytes:
        """Return ``(H, W, 3)`` uint8 RGB as a JPEG file."""
        return _jpeg(array)

    def columns(self, payloads: list[bytes]) -> Any:
        """Return columns of encoded images; the viewer tells JPEG from PNG by itself."""
        import rerun as rr

        return rr.EncodedImage.columns(blob=payloads)

    def decode(self, payload: bytes) -> Array:
        """Return ``(H, W, 3)`` uint8 RGB."""
        return images.to_rgb(payload, limits_for(self.width, self.height))


@dataclass(frozen=True)
class ImageCodec(CameraCodec):
    """A colour image that a stage made."""

    exact: bool

    def encode(self, array: Array) -> bytes:
        """Return ``(H, W, 3)`` uint8 RGB as a PNG file, or a small JPEG file."""
        if self.exact:
            return png.encode_levels(array)
        return _jpeg(_halve(array))

    def decode(self, payload: bytes) -> Array:
        """Return ``(H, W, 3)`` uint8 RGB at full resolution."""
        return _restore(super().decode(payload), self.width, self.height)


def _halve(array: Array) -> Array:
    height, width = array.shape[:2]
    half = ((width + 1) // 2, (height + 1) // 2)
    small: Array = cv2.resize(array, half, interpolation=cv2.INTER_AREA)
    return small


def _restore(array: Array, width: int, height: int) -> Array:
    if array.shape[:2] == (height, width):
        return array
    full: Array = cv2.resize(array, (width, height))
    return full


def _jpeg(rgb: Array) -> bytes:
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()


def limits_for(width: int, height: int) -> Limits:
    """Return the limits on an image's size: the recording's own size is always allowed."""
    return Limits(max(MAX_PIXELS, width * height))
