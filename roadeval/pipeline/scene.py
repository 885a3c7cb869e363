"""The working image, on which texture means the same for every camera, and its conversions.

A `Scene` holds the arrays that all features of a frame share. A classifier of colours learns the
exposure and the camera along with the road. The reference patch, which is road in nearly every
frame, is a measure of both: `expose_by_patch` gives it the same grey in each frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import cv2
import numpy as np

from roadeval.data import Mask, Rgb
from roadeval.data.arrays import Floats, Values
from roadeval.kernels import KERNELS
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import split

LEVEL: Final = 96.0
"""Grey level, 0..255, that the median of an exposed patch gets."""
GREATEST_GAIN: Final = 6.0
"""Greatest gain of a channel: a black patch says nothing about the light."""
NOISE: Final = (0.06, 0.02, 0.02)
"""Deviations of log brightness and of two log-chromaticities that any patch may have."""
LOGS: Final = np.log(np.arange(256) + 8.0).astype(np.float32)
"""``(256,)`` float32: logarithm of a channel plus 8, which bounds the logarithms of dark, noisy
pixels."""

THIN, WIDE = 3, 15
"""Sides of the squares with different means at a thin line."""
SURROUNDINGS: Final = 31
"""Side of the square that an edge is compared with: on a smooth pavement a low kerb is steep."""
FAINT: Final = 0.02
"""Added to that square's mean edge: noise is not an edge."""
BARRIERS: Final = {"edge": 1.0, "relative_edge": 0.05, "hue_edge": 1.0, "yellow": 1.0, "dark": 1.0}
"""Weights of barriers in the cost of a path."""
SQUARED: Final = {"edge": 20.0, "relative_edge": 0.05}
"""Weights of squared barriers in the costs of further paths. These go a long way over faint edges
before they cross a steep one: around the end of a kerb, not over it."""
ROUNDS: Final = 3
"""Sweeps up and down. More would shorten the paths to about 1 % of the pixels by 1 %."""
SCALE: Final = 10_000
"""Scale of costs as whole numbers: the least has two digits."""
FLOOR: Final = 0.005
"""Cost of a step on the smoothest ground, so that a longer path costs more."""
GREATEST: Final = 6.5
"""Greatest cost of a step, which fits in 16 bit."""

Tones = tuple[Values, Values, Values]
"""Log brightness ``(ln R + ln G + ln B) / 3``, and the log-chromaticities ``ln R - ln G`` and
``ln B - ln G``, in which brightness cancels; ``(h, w)`` float32 each."""

OVER_EDGES: Final = 1.0
"""Distance at which roads end, over the edges of the working image; it grows with every edge that a
path crosses."""
AROUND_EDGES: Final = 1.5
"""Distance at which roads end, over the squared edges of the image at twice its size; it grows at
steep edges, thin kerbs included. Both values are the best, or next to it, on the train part of IDD
Lite, on CamVid 0016E5 and 0006R0 and a synthetic drive; for working images of 160 columns, made of
320 or more: edges of smaller images are blurred, and more is reached. They hold after the stage
`exposure`, which weakens edges among pixels brighter than the patch."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The working image of a frame, and the arrays that its features share."""

    image: Rgb
    """``(h, w, 3)`` uint8 RGB: the working image."""
    fine: Rgb
    """``(2 h, 2 w, 3)`` uint8 RGB: the image at twice the size, where thin things survive."""
    patch: Mask
    """``(h, w)`` uint8: the reference patch, nonzero inside."""
    tones: Tones
    """The tones of the working image."""
    middle: tuple[float, ...]
    """The patch's median of each tone."""
    hue: Values
    """Distance of the log-chromaticities to the patch's medians, in the patch's deviations."""
    colour: Values
    """Distance of all three tones to them, in the same unit."""
    slopes: tuple[Values, Values]
    """Slopes of the log brightness per pixel across and down, by Sobel's operator."""
    edge: Values
    """Magnitude of the slopes."""

    @classmethod
    def of(cls, image: Rgb, fine: Rgb, patch: ReferencePatch) -> Scene:
        """Return the scene of an image, and of the same image at twice its size."""
        tones, area = tones_of(image), patch_mask(*image.shape[:2], patch)
        middle, hue, colour = from_patch(tones, area)
        slopes = slopes_of(tones[0])
        return cls(image, fine, area, tones, middle, hue, colour, slopes, steepness(slopes))

    @cached_property
    def over_edges(self) -> Values:
        """`distance` from the patch over edges."""
        return distance(self.edge, self.patch)

    @cached_property
    def barriers(self) -> dict[str, Values]:
        """Barriers by the names in `BARRIERS`: the greatest of each four pixels of the fine image.

        So a line of one pixel is not averaged away. They are the gradient of the log brightness;
        that gradient relative to its surroundings; the sum of the chromaticities' gradients; and
        how much a thin line is yellower, ``(ln R + ln G) / 2 - ln B``, or darker than its
        surroundings.
        """
        bright, red, blue = tones_of(self.fine)
        edge = steepness(slopes_of(bright))
        yellow = 1 / 2 * red - blue
        fine = (
            edge,
            edge / (mean(edge, SURROUNDINGS) + FAINT),
            steepness(slopes_of(red)) + steepness(slopes_of(blue)),
            np.maximum(mean(yellow, THIN) - mean(yellow, WIDE), 0),
            np.maximum(mean(bright, WIDE) - mean(bright, THIN), 0),
        )
        rows = (np.maximum(plane[::2], plane[1::2]) for plane in fine)
        greatest = [np.maximum(plane[:, ::2], plane[:, 1::2]) for plane in rows]
        return dict(zip(BARRIERS, greatest, strict=True))

    @cached_property
    def around_edge(self) -> Values:
        """`around` the gradient of the log brightness."""
        return self.around("edge")

    def around(self, barrier: str) -> Values:
        """Compute the `distance` from the patch over a squared barrier, one of `SQUARED`."""
        return distance(np.square(self.barriers[barrier]) * SQUARED[barrier], self.patch)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.edge.shape


def scene_of(image: Rgb, width: int, patch: ReferencePatch) -> Scene:
    """Return the scene of an ``(H, W, 3)`` uint8 RGB image, ``width`` columns wide."""
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    way = cv2.INTER_AREA if image.shape[1] >= 2 * width else cv2.INTER_LINEAR
    fine = cv2.resize(image, (2 * width, 2 * height), interpolation=way)
    small = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    return Scene.of(small, fine, patch)


def reach(scene: Scene) -> Values:
    """Return how far each pixel lies from the patch, ``(h, w)`` float32; roads end at about 1.

    It is ``(over / OVER_EDGES + around / AROUND_EDGES) / 2`` of the distances over edges and over
    squared edges. It needs no training, and most roads end at about the same value, whatever the
    camera. Hue does not count: a verge as bright as the road is reached.
    """
    return 1 / 2 * (scene.over_edges / OVER_EDGES + scene.around_edge / AROUND_EDGES)


def tones_of(image: Rgb) -> Tones:
    """Return the tones of ``(h, w, 3)`` uint8 RGB."""
    red, green, blue = (cv2.LUT(plane, LOGS) for plane in split(image))
    return (red + green + blue) / 3, red - green, blue - green


def from_patch(tones: Tones, patch: Mask) -> tuple[tuple[float, ...], Values, Values]:
    """Return a patch's medians, and each pixel's distance of hues and of colours to them.

    The unit is 1.48 times the patch's median absolute deviations, plus `NOISE`: a car or paint that
    covers less than half of the patch hardly changes medians and unit.
    """
    inside = patch > 0
    medians, squares = [], []
    for plane, noise in zip(tones, NOISE, strict=True):
        values = plane[inside]
        middle = np.median(values)
        spread = 1.48 * np.median(np.abs(values - middle)) + noise
        medians.append(float(middle))
        squares.append(np.square((plane - middle) / spread))
    light, first, second = squares
    return tuple(medians), np.sqrt(first + second), np.sqrt(light + first + second)


def slopes_of(plane: Values) -> tuple[Values, Values]:
    """Return the slopes per pixel of an ``(h, w)`` image across and down, by Sobel's operator."""
    across, down = (cv2.Sobel(plane, cv2.CV_32F, x, 1 - x, scale=1 / 8) for x in (1, 0))
    return across, down


def distance(cost: Values, patch: Mask) -> Values:
    """Return the geodesic distance of each pixel from a patch, in pixels.

    It is ``min over paths of the integral of 0.005 + c`` (Toivanen 1996, see
    `roadeval.kernels.plain`, where a straight step is 10 long) for a cost c of each pixel,
    ``(h, w)`` float32, at most `GREATEST`.
    """
    costs = np.rint(np.minimum(cost + FLOOR, GREATEST) * SCALE).astype(np.uint16)
    return KERNELS.geodesics(costs, patch, ROUNDS).astype(np.float32) / (10 * SCALE)


def steepness(slopes: tuple[Values, Values]) -> Values:
    """Return the magnitude of slopes.

    OpenCV's rounding depends on an array's place in memory: with it the same frame would not give
    the same features twice.
    """
    across, down = slopes
    return np.sqrt(across * across + down * down)


def mean(plane: Values, side: int) -> Values:
    """Return an ``(h, w)`` image's means over squares."""
    return cv2.blur(plane, (side, side))


def reduce_to(image: Rgb, width: int) -> Rgb:
    """Reduce an ``(H, W, 3)`` uint8 image to ``width`` columns by area means; never enlarge it."""
    if image.shape[1] <= width:
        return image
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)


def enlarge(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """Resize a mask or label image to the height and width of ``shape``, to the nearest pixel."""
    return cv2.resize(mask, shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT)


def stretch(values: Values, shape: tuple[int, ...]) -> Values:
    """Resize float32 values to the height and width of ``shape``, interpolated linearly."""
    return cv2.resize(values, shape[1::-1])


def expose_by_patch(image: Rgb, patch: ReferencePatch) -> Rgb:
    """Return an ``(H, W, 3)`` uint8 image whose patch has the median grey `LEVEL`."""
    return expose(image, gains(image, patch), LEVEL)


def gains(image: Rgb, patch: ReferencePatch) -> Floats:
    """Return the gains ``(3,)`` that bring the patch of an ``(H, W, 3)`` image to `LEVEL`.

    Each channel has a gain of its own, so that the road turns grey under any light and camera.
    """
    rows, columns, mask = patch_box(*image.shape[:2], patch)
    medians = []
    for channel in range(3):
        counts = cv2.calcHist([image[rows, columns]], [channel], mask, [256], [0, 256]).cumsum()
        medians.append(float(np.searchsorted(counts, counts[-1] / 2)))  # the lower one
    return np.minimum(LEVEL / np.maximum(medians, 1.0), GREATEST_GAIN)


@lru_cache(maxsize=16)
def patch_box(height: int, width: int, patch: ReferencePatch) -> tuple[slice, slice, Mask]:
    """Return rows and columns of the smallest box around the patch, and the patch's mask in it."""
    mask = patch_mask(height, width, patch)
    x, y, columns, rows = cv2.boundingRect(mask)
    here = slice(y, y + rows), slice(x, x + columns)
    return *here, mask[here]


def expose(image: Rgb, gain: Floats, level: float) -> Rgb:
    """Multiply the channels of an ``(H, W, 3)`` uint8 image by ``(3,)`` gains, and compress them.

    A product x up to the level l, a grey level below 255, stays unchanged. A greater x becomes
    ``l + r e / (e + r)``, with ``e = x - l`` and ``r = 255 - l``: the slope is 1 at the level, and
    255 is only approached. The result is rounded.
    """
    product = np.arange(256)[:, None] * gain
    excess, room = np.maximum(product - level, 0), 255 - level
    compressed = np.minimum(product, level) + room * excess / (excess + room)
    table = np.rint(compressed).astype(np.uint8)
    return cv2.LUT(image, table[None])
