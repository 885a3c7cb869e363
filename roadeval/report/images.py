"""Camera images and layers as pictures: each layer is coloured by its description."""

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
"""Pixels across an example's picture, at most."""
WIDTH: Final = 420
"""Pixels across a picture, at most: about 200 an inch at a quarter of the page."""
QUALITY: Final = 85
FINEST: Final = 95
"""Quality of a JPEG, and of one of which a figure is made."""
FADED: Final = 5
"""The part of the camera's contrast that is left where there is no mask, as one of so many."""
DARKEN: Final = 0.75
"""Share of the camera's brightness that stays below an overlay."""

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
    """The layer, as in `roadeval.data.Layer`; None for the camera's image alone. A scalar map is in
    its own unit."""


@dataclass(frozen=True, eq=False)
class ExampleFrame:
    """A frame to show: its image, its truth if it has one, and the final masks of variants."""

    frame: int
    image: Rgb
    """``(H, W, 3)`` uint8 RGB."""
    truth: Truth | None
    """``(H, W)`` uint8 (0, 1, 255)."""
    masks: Mapping[str, Mask]
    """``(H, W)`` uint8 (0, 1) by variant; one whose masks another system has made may have none."""

    def small(self) -> ExampleFrame:
        """Return the example in the size in which it is drawn, of which a run can hold a few."""
        return ExampleFrame(
            self.frame,
            shrink(self.image, EXAMPLE_WIDTH),
            None if self.truth is None else shrink(self.truth, EXAMPLE_WIDTH, labels=True),
            {name: shrink(mask, EXAMPLE_WIDTH, labels=True) for name, mask in self.masks.items()},
        )


def pictures_of(examples: Sequence[ExampleFrame]) -> Iterator[dict[str, Rgb]]:
    """Yield each example's pictures by their titles: the image, and masks and truth over it.

    A variant that has no mask of a frame has the image nearly white. All have the same titles.
    """
    names = dict.fromkeys(name for each in examples for name in each.masks)
    labelled = any(each.truth is not None for each in examples)
    for each in examples:
        found = {"camera image": each.image}
        for name in names:
            mask = each.masks.get(name)
            over = None if mask is None else painted(LayerImage(name, each.image, ROAD, mask))
            found[name] = faded(each.image) if over is None else over
        if labelled:
            found["truth"] = painted(LayerImage("truth", each.image, TRUTH, each.truth))
        yield found


def example_grid(
    examples: Sequence[ExampleFrame], caption: str = "", *, finest: bool = False
) -> ImageGrid:
    """Return a row a frame: the image, each variant's mask over it, and the truth over it.

    Pictures are at most `WIDTH` pixels across, but for the ``finest``: those keep their size, and
    in them a line of one pixel keeps its colour.
    """
    rows = [*pictures_of(examples)]
    pictures = [
        (
            title if place else f"frame {example.frame}",
            _finest_jpeg(picture) if finest else jpeg(LayerImage(title, picture)),
        )
        for example, row in zip(examples, rows, strict=True)
        for place, (title, picture) in enumerate(row.items())
    ]
    return ImageGrid(pictures, len(rows[0]), caption=caption)


def jpeg(layer: LayerImage, width: int = WIDTH) -> ImageFile:
    """Return the layer as a JPEG file of at most ``width`` pixels across."""
    import cv2

    return _encode_jpeg(shrink(painted(layer), width), cv2.IMWRITE_JPEG_QUALITY, QUALITY)


def _finest_jpeg(image: Rgb) -> ImageFile:
    import cv2

    colours = cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
    return _encode_jpeg(image, cv2.IMWRITE_JPEG_QUALITY, FINEST, *colours)


def _encode_jpeg(image: Rgb, *options: int) -> ImageFile:
    import cv2

    done, content = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    assert done
    return ImageFile(bytes(content))


def painted(layer: LayerImage) -> Rgb:
    """Return the layer as ``(H, W, 3)`` uint8 RGB."""
    if layer.spec is None or layer.array is None:
        return layer.image
    match layer.spec.kind:
        case LayerKind.RGB:
            return layer.array.astype(np.uint8, copy=False)
        case LayerKind.SCALAR:
            return _coloured(layer.spec, layer.array)
        case LayerKind.MASK | LayerKind.LABELS:
            return _overlaid(layer.image, layer.spec, layer.array)


def _coloured(spec: LayerSpec, values: npt.NDArray[Any]) -> Rgb:
    """Colour a map of numbers over its range with Viridis, as the recording's viewer does."""
    import cv2

    low, high = spec.value_range
    codes = np.clip((values - low) * (255 / (high - low)), 0, 255).astype(np.uint8)
    bgr = cv2.applyColorMap(codes, cv2.COLORMAP_VIRIDIS)
    rgb: Rgb = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
    return rgb


def _overlaid(image: Rgb, spec: LayerSpec, labels: npt.NDArray[Any]) -> Rgb:
    """Draw the classes' colours over the darkened image."""
    import cv2

    colours = np.zeros((256, 4), np.float32)
    for known in spec.classes:
        colours[known.value] = known.rgba
    overlaid: Rgb = np.empty_like(image)
    # A pixel's colour follows from its label and its own: a table of 256 for each label.
    for label in np.flatnonzero(np.bincount(labels.ravel(), minlength=256)):
        opacity = colours[label, 3:] / 255
        mixed = _LEVELS * DARKEN * (1 - opacity) + colours[label, :3] * opacity
        tinted = cv2.LUT(image, np.rint(mixed).astype(np.uint8)[None])
        cv2.copyTo(tinted, (labels == label).view(np.uint8), overlaid)
    return overlaid


def heat_map(shares: Floats, top: float, colour: colours.Colour) -> ImageFile:
    """Draw ``(rows, columns)`` shares in shades from white at 0 to the darkest at ``top``.

    ``colour`` is half-way between; NaN is grey.
    """
    known = np.nan_to_num(shares / (top or 1.0))[..., None]
    ends = [np.array(each, float) for each in ((255, 255, 255), colour, colours.MOST_ERRORS)]
    light, dark = np.minimum(2 * known, 1), np.maximum(2 * known - 1, 0)
    cells = ends[0] + light * (ends[1] - ends[0]) + dark * (ends[2] - ends[1])
    cells[np.isnan(shares)] = colours.NEVER_LABELLED
    scale = max(WIDTH // shares.shape[1], 1)
    picture = np.rint(cells).astype(np.uint8).repeat(scale, axis=0).repeat(scale, axis=1)
    picture[[0, -1]] = picture[:, [0, -1]] = colours.NEVER_LABELLED
    return ImageFile(png_of(picture))


def faded(image: Rgb) -> Rgb:
    """Return an image nearly white, in place of a mask that there is not."""
    return np.asarray(255 - (255 - image) // FADED, np.uint8)


def shrink(
    image: npt.NDArray[np.uint8], width: int, *, labels: bool = False
) -> npt.NDArray[np.uint8]:
    """Reduce an image to ``width`` pixels across, if it is wider; of labels none is mixed."""
    import cv2

    height, wide = image.shape[:2]
    if wide <= width:
        return image
    size = width, max(round(height * width / wide), 1)
    how = cv2.INTER_NEAREST if labels else cv2.INTER_AREA
    small: npt.NDArray[np.uint8] = cv2.resize(image, size, interpolation=how)
    return small
