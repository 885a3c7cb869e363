"""Codecs of scalar maps and of colour images: those that need not be exact lose a little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np

from roadeval import images
from roadeval.data import LayerSpec
from roadeval.recording import png
from roadeval.recording.codecs.codec import Array, limits_for

JPEG_QUALITY: Final = 90
"""Of camera images that the log does not hold as JPEG or PNG, and of layers that need not be
exact: those have half the resolution, which costs less than a quality that shows."""

# Every fifth level: as evenly spread as 0 to 255 allow, so that differences of neighbours are few.
_FIFTHS: Final = (np.rint(np.arange(256) / 5) * 5).astype(np.uint8)


@dataclass(frozen=True)
class ScalarCodec:
    """A map of numbers: a grey PNG whose levels span the range, coloured by the viewer."""

    spec: LayerSpec
    width: int
    height: int
    component = "EncodedDepthImage:blob"

    def style(self) -> Sequence[Any]:
        """Return the colour map; the viewer takes grey levels for fractions, whatever the unit."""
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
        """Return ``(H, W)`` float32, or uint8 codes that span the range, as a PNG file."""
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
    """The camera's image: JPEG or PNG, whatever the log holds."""

    width: int
    height: int
    component = "EncodedImage:blob"

    def style(self) -> Sequence[Any]:
        """Return a style that is drawn below every mask."""
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
