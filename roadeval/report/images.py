"""Camera images and layers as pictures; a layer's description gives its colours."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import TRUTH, LayerKind, LayerSpec, Mask, Rgb, Truth, colours, mask_spec
from roadeval.data.arrays import Floats
from roadeval.images.decoding import png_of
from roadeval.report.blocks import ImageFile, ImageGrid

ROAD: Final = mask_spec("road", "road")
EXAMPLE_WIDTH: Final = 400
"""Greatest width of an example's picture in pixels."""
WIDTH: Final = 420
"""Greatest width of a picture in pixels: about 200 an inch at a quarter of the page."""
QUALITY: Final = 85
FINEST: Final = 95
"""Qualities of JPEGs: in a report, and in a figure of the paper."""
FADED: Final = 5
"""Divisor of the contrast of an image that has no mask."""
DARKEN: Final = 0.75
"""Share of the image's brightness that remains below an overlay."""

_LEVELS: Final = np.arange(256, dtype=np.uint8)[:, None]


@dataclass(frozen=True, eq=False)
class LayerImage:
    """One layer of one frame."""

    title: str
    """A few words."""
    image: Rgb
    """``(H, W, 3)`` uint8 RGB: the camera's image."""
    spec: LayerSpec | None = None
    array: npt.NDArray[Any] | None = None
    """The layer, as in `roadeval.data.Layer`; None for the camera's image alone. The values of a
    scalar map are in its unit."""


@dataclass(frozen=True, eq=False)
class ExampleFrame:
    """A frame to show: its image, its truth if it has one, and the final masks of variants."""

    frame: int
    image: Rgb
    """``(H, W, 3)`` uint8 RGB."""
    truth: Truth | None
    """``(H, W)`` uint8 (0, 1, 255)."""
    masks: Mapping[str, Mask]
    """``(H, W)`` uint8 (0, 1) by variant; a method from outside may lack the frame's mask."""

    def small(self) -> ExampleFrame:
        """Return the example reduced to `EXAMPLE_WIDTH` pixels across, to save memory."""
        return ExampleFrame(
            self.frame,
            shrink(self.image, EXAMPLE_WIDTH),
            None if self.truth is None else shrink(self.truth, EXAMPLE_WIDTH, labels=True),
            {name: shrink(mask, EXAMPLE_WIDTH, labels=True) for name, mask in self.masks.items()},
        )


def pictures_of(examples: Sequence[ExampleFrame]) -> Iterator[dict[str, Rgb]]:
    """Yield each example's pictures by their titles: the image alone, with masks, and with truth.

    A nearly white image takes the place of a missing mask. All examples have the same titles.
    """
    names = dict.fromkeys(name for example in examples for name in example.masks)
    labelled = any(example.truth is not None for example in examples)
    for example in examples:
        image = example.image
        pictures = {"camera image": image}
        for name in names:
            mask = example.masks.get(name)
            there = fade(image) if mask is None else image
            pictures[name] = paint(LayerImage(name, there, ROAD, mask))
        if labelled:
            pictures["truth"] = paint(LayerImage("truth", image, TRUTH, example.truth))
        yield pictures


def example_grid(examples: Sequence[ExampleFrame], caption: str = "") -> ImageGrid:
    """Return a row for each frame: the image alone, with each variant's mask, and with truth."""
    rows = [*pictures_of(examples)]
    pictures = [
        (title if place else f"frame {example.frame}", jpeg(LayerImage(title, picture)))
        for example, row in zip(examples, rows, strict=True)
        for place, (title, picture) in enumerate(row.items())
    ]
    return ImageGrid(pictures, len(rows[0]), caption=caption)


def jpeg(layer: LayerImage, width: int = WIDTH) -> ImageFile:
    """Return the layer as a JPEG file of at most ``width`` pixels across."""
    return ImageFile(encode_jpeg(painted(layer, width).image))


def painted(layer: LayerImage, width: int = WIDTH) -> LayerImage:
    """Return a picture of the layer of at most ``width`` pixels across, to save memory."""
    return LayerImage(layer.title, shrink(paint(layer), width))


def encode_jpeg(image: Rgb, *, finest: bool = False) -> bytes:
    """Return an image as a JPEG file; if ``finest``, a line of one pixel keeps its colour."""
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, FINEST if finest else QUALITY]
    if finest:
        options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    done, content = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    assert done
    return bytes(content)


def paint(layer: LayerImage) -> Rgb:
    """Return the layer as ``(H, W, 3)`` uint8 RGB."""
    import cv2

    if layer.spec is None or layer.array is None:
        return layer.image
    match layer.spec.kind:
        case LayerKind.RGB:
            return layer.array.astype(np.uint8, copy=False)
        case LayerKind.SCALAR:
            # Viridis over its range, as in the recording's viewer.
            low, high = layer.spec.value_range
            codes = np.clip((layer.array - low) * (255 / (high - low)), 0, 255).astype(np.uint8)
            bgr = cv2.applyColorMap(codes, cv2.COLORMAP_VIRIDIS)
            return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
        case LayerKind.MASK | LayerKind.LABELS:  # the classes' colours over the darkened image
            classes = np.zeros((256, 4), np.float32)
            for label_class in layer.spec.classes:
                classes[label_class.value] = label_class.rgba
            overlaid: Rgb = np.empty_like(layer.image)
            # The new colour depends on the label and the old colour: a table of 256 for each label.
            for label in np.flatnonzero(np.bincount(layer.array.ravel(), minlength=256)):
                opacity = classes[label, 3:] / 255
                mixed = _LEVELS * DARKEN * (1 - opacity) + classes[label, :3] * opacity
                tinted = cv2.LUT(layer.image, np.rint(mixed).astype(np.uint8)[None])
                cv2.copyTo(tinted, (layer.array == label).view(np.uint8), overlaid)
            return overlaid


def heat_map(shares: Floats, top: float, colour: colours.Colour) -> ImageFile:
    """Draw ``(rows, columns)`` shares in shades from white at 0 to the darkest at ``top``.

    ``colour`` is the shade half-way between the two; NaN is grey.
    """
    levels = np.nan_to_num(shares / (top or 1.0))[..., None]
    white, middle, darkest = np.array([(255, 255, 255), colour, colours.MOST_ERRORS], float)
    light, dark = np.minimum(2 * levels, 1), np.maximum(2 * levels - 1, 0)
    cells = white + light * (middle - white) + dark * (darkest - middle)
    cells[np.isnan(shares)] = colours.NEVER_LABELLED
    scale = max(WIDTH // shares.shape[1], 1)
    picture = np.rint(cells).astype(np.uint8).repeat(scale, axis=0).repeat(scale, axis=1)
    picture[[0, -1]] = picture[:, [0, -1]] = colours.NEVER_LABELLED
    return ImageFile(png_of(picture))


def fade(image: Rgb) -> Rgb:
    """Return a nearly white image, which takes the place of a missing mask."""
    return np.asarray(255 - (255 - image) // FADED, np.uint8)


def shrink(
    image: npt.NDArray[np.uint8], width: int, *, labels: bool = False
) -> npt.NDArray[np.uint8]:
    """Return an image at most ``width`` pixels wide; ``labels`` are not mixed."""
    import cv2

    height, wide = image.shape[:2]
    if wide <= width:
        return image
    size = width, max(round(height * width / wide), 1)
    method = cv2.INTER_NEAREST if labels else cv2.INTER_AREA
    return cv2.resize(image, size, interpolation=method)
