"""Codecs of masks and of label images: nothing is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from roadeval import images
from roadeval.data import LayerSpec
from roadeval.data.packed import Packed
from roadeval.recording import png
from roadeval.recording.codecs.codec import Array, limits_for


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
        """Return a style that is drawn above the camera's image."""
        import rerun as rr

        return [rr.EncodedImage.from_fields(media_type="image/png", draw_order=10)]

    def encode(self, array: npt.NDArray[np.uint8] | Packed) -> bytes:
        """Return ``(H, W)`` uint8, or the bits of two classes, as a PNG file.

        It may hold the classes' values only: there is no colour for another.
        """
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
