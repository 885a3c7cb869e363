"""Features of a pixel of the ground, in groups; each group is one idea of how road differs.

A group is a function of the `Scene`, in `GROUPS`. It returns its features by name, each ``(h, w)``
float32 or an array that NumPy broadcasts to that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

import cv2
import numpy as np

from roadeval.data import CERTAIN, Packed, Probability, Rgb
from roadeval.data.arrays import Places, Values
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.scene import BARRIERS, Scene, distance, mean
from roadeval.pipeline.stage import Output, TrainingSet

Named = Mapping[str, Values]
"""Features by name."""

TONES: Final = ("light", "red_green", "blue_green")
"""Names of the tones."""

ANGLES: Final = (30, 45, 60)
"""Directions of the projections, in degrees from ``ln R - ln G`` towards ``ln B - ln G``."""
SMOOTH: Final = 7
"""Side of the square over which the distance to the patch is averaged."""
PERCENTILES: Final = (50, 80)
"""Percentiles of the log brightness in the lower half."""
TEXTURES: Final = (3, 9, 21)
"""Sides of the squares over which slopes are averaged."""
DEVIATION: Final = 9
"""Side of the square in which the log brightness deviates."""
WINDOWS: Final = (7, 19, 41)
"""Sides of the squares over which tones are averaged; the first is compared at the offsets."""
OFFSETS: Final = ((-14, 0), (14, 0), (28, 0), (-28, 0), (0, 20), (0, -20))
"""Columns and rows to the squares compared with it. The border is repeated beyond the image."""
_ACROSS, _DOWN = (max(abs(offset[way]) for offset in OFFSETS) for way in (0, 1))


def colour(scene: Scene) -> Named:
    """Return red, green, blue, the tones, their projections, and the distances to the patch.

    A projection of the log-chromaticities on the right direction does not change between sunlight
    and skylight. That direction depends on the camera (Alvarez and Lopez 2011), so there are three.
    """
    red, blue = (scene.tones[i] - scene.middle[i] for i in (1, 2))
    channels = np.moveaxis(scene.image.astype(np.float32), 2, 0)
    projections = {
        f"projection_{angle}": red * math.cos(math.radians(angle))
        + blue * math.sin(math.radians(angle))
        for angle in ANGLES
    }
    return {
        **dict(zip(("red", "green", "blue"), channels, strict=True)),
        **dict(zip(TONES, scene.tones, strict=True)),
        **projections,
        "colour_distance": scene.colour,
        "hue_distance": scene.hue,
        "colour_distance_around": mean(scene.colour, SMOOTH),
    }


def light(scene: Scene) -> Named:
    """Return log brightness relative to the lower half and to the row, and a row's median colour.

    These features do not depend on the patch: if it lies in the shade of a lorry, the sunlit road
    is too bright compared with it, but not compared with the lower half of the image.
    """
    bright = scene.tones[0]
    return {
        **light_over(scene, *PERCENTILES),
        "light_over_row": bright - bright.mean(axis=1, keepdims=True),
        "colour_distance_of_row": np.median(scene.colour, axis=1, keepdims=True),
    }


def light_over(scene: Scene, *percentiles: int) -> Named:
    """Return log brightness less percentiles of the lower half's, ``(h, w)`` float32 each."""
    bright = scene.tones[0]
    levels = np.percentile(bright[scene.shape[0] // 2 :], percentiles)
    return {
        f"light_over_{percentile}th_percentile": bright - float(level)
        for percentile, level in zip(percentiles, levels, strict=True)
    }


def place(scene: Scene) -> Named:
    """Return column (-1 to 1), its magnitude, and row (0 to 1) of each pixel's centre."""
    height, width = scene.shape
    across = (np.arange(width, dtype=np.float32) + 0.5) * (2 / width) - 1
    down = (np.arange(height, dtype=np.float32) + 0.5) / height
    return {"across": across[None], "from_middle": np.abs(across)[None], "down": down[:, None]}


def texture(scene: Scene) -> Named:
    """Return the root of the mean absolute slope of the log brightness, and its deviation.

    Slopes across and down are separate features: kerbs, wheels and house fronts have edges in one
    direction, leaves in both.
    """
    slopes = {"across": np.abs(scene.slopes[0]), "down": np.abs(scene.slopes[1])}
    bright = scene.tones[0]
    variance = mean(bright * bright, DEVIATION) - np.square(mean(bright, DEVIATION))
    return {
        **{f"{w}_{side}": np.sqrt(mean(slopes[w], side)) for side in TEXTURES for w in slopes},
        "deviation": np.sqrt(np.maximum(variance, 0)),
    }


def surroundings(scene: Scene) -> Named:
    """Return means of tones, and differences of means of light, blue-green and colour distance."""
    tones = dict(zip(TONES, scene.tones, strict=True))
    planes = {f"{tone}_{side}": mean(tones[tone], side) for side in WINDOWS for tone in TONES}
    compared = {tone: planes[f"{tone}_{WINDOWS[0]}"] for tone in ("light", "blue_green")}
    compared["colour_distance"] = mean(scene.colour, WINDOWS[0])
    height, width = scene.shape
    for name, plane in compared.items():
        wide = cv2.copyMakeBorder(plane, *(_DOWN,) * 2, *(_ACROSS,) * 2, cv2.BORDER_REPLICATE)
        for across, down in OFFSETS:
            there = wide[_DOWN + down :, _ACROSS + across :][:height, :width]
            planes[f"{name}_to_{across}_{down}"] = plane - there
    return planes


def scans(scene: Scene) -> Named:
    """Return the summaries of `_column` below and above, and extremes from the middle outwards.

    In a row these are the root of the steepest slope across, and the furthest hue. A vehicle that
    drives up the column to the pixel meets no kerb and no shadow under a car while on the road.
    """
    steep = cv2.blur(np.abs(scene.slopes[0]), (3, 5))
    return {
        **{f"{name}_below": plane for name, plane in _column(scene, -1).items()},
        **{f"{name}_above": plane for name, plane in _column(scene, 1).items()},
        "edge_inside": greatest_outwards(np.sqrt(steep)),
        "hue_inside": greatest_outwards(mean(scene.hue, 3)),
    }


def _column(scene: Scene, step: int) -> Named:
    """Summarise each column up to every pixel, from below (``step`` -1) or above (1).

    The features are the root of the steepest slope down, the least and the greatest log brightness,
    the mean distance of colours to the patch, the greatest of hues, and the sum of edges.
    """
    light, colour = mean(scene.tones[0], 5)[::step], mean(scene.colour, 3)[::step]
    steep = np.sqrt(cv2.blur(np.abs(scene.slopes[1]), (5, 3)))[::step]
    count = np.arange(1, len(light) + 1, dtype=np.float32)[:, None]
    met = {
        "edge": np.maximum.accumulate(steep),
        "darkest": np.minimum.accumulate(light),
        "brightest": np.maximum.accumulate(light),
        "mean_colour": np.add.accumulate(colour) / count,
        "furthest_hue": np.maximum.accumulate(mean(scene.hue, 3)[::step]),
        "sum_of_edges": np.add.accumulate(cv2.blur(scene.edge, (5, 3))[::step]),
    }
    return {name: plane[::step] for name, plane in met.items()}


def greatest_outwards(plane: Values) -> Values:
    """Return the greatest value met along a row from the image's middle to each pixel."""
    half = plane.shape[1] // 2
    greatest = np.empty_like(plane)
    np.maximum.accumulate(plane[:, half:], axis=1, out=greatest[:, half:])
    left = np.s_[:, half - 1 :: -1] if half else np.s_[:, :0]
    greatest[left] = np.maximum.accumulate(plane[left], axis=1)
    return greatest


def paths(scene: Scene) -> Named:
    """Return the geodesic distances over edges, over edges and hues, and over colours.

    Every path from the ground in front of the vehicle to a place behind a kerb, a line of parked
    cars or a change of colour crosses it, and the cheapest path goes around a mark, a shadow or a
    drain. So the distance is small on the road wherever it leads, and grows by a step at its edge.
    With the gradient g of the log brightness per pixel, and the distances h of hues and d of
    colours to the patch in its deviations, the costs of a pixel are ``g``,
    ``g / 2 + min(h, 10) / 20`` and ``0.03 min(d, 15)``.
    """
    hue = 1 / 20 * np.minimum(scene.hue, 10)
    return {
        "over_edges": scene.over_edges,
        "over_edges_and_hues": distance(1 / 2 * scene.edge + hue, scene.patch),
        "over_colours": distance(0.03 * np.minimum(scene.colour, 15), scene.patch),
    }


def barriers(scene: Scene) -> Named:
    """Return each barrier at a pixel, on its path from the patch, and from the middle outwards.

    The barriers are kerbs, seams, yellow and dark lines: `Scene.barriers`. The distances over the
    squares of `SQUARED` come last. Each is ``(h, w)`` float32; a `distance` is in pixels.
    """
    planes = scene.barriers
    return {
        **planes,
        **{f"over_{name}": distance(planes[name] * w, scene.patch) for name, w in BARRIERS.items()},
        **{f"{name}_inside": greatest_outwards(plane) for name, plane in planes.items()},
        "around_edge": scene.around_edge,
        "around_relative_edge": scene.around("relative_edge"),
    }


GROUPS: Final[Mapping[str, Callable[[Scene], Named]]] = {
    group.__name__: group
    for group in (barriers, colour, light, paths, place, scans, surroundings, texture)
}


@cache
def names_of(groups: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the features of some groups, as ``group.feature``."""
    grey = np.full((24, 32, 3), 128, np.uint8)
    scene = Scene.of(grey, cv2.resize(grey, (64, 48)), ReferencePatch())
    return tuple(f"{group}.{name}" for group in groups for name in GROUPS[group](scene))


def features(scene: Scene, groups: tuple[str, ...]) -> Values:
    """Compute the features of some groups, ``(F, h, w)`` float32 in the order of `names_of`."""
    planes = np.empty((len(names_of(groups)), *scene.shape), np.float32)
    values = (plane for name in groups for plane in GROUPS[name](scene).values())
    for plane, feature in zip(planes, values, strict=True):
        plane[...] = feature
    return planes


SURE: Final = 1 / CERTAIN
"""The probability nearest to 0 or 1 whose log-odds are computed."""


def _probabilities(opinion: Output) -> tuple[Probability, ...]:
    return opinion.by_class or (() if opinion.probability is None else (opinion.probability,))


def opinion_features(opinion: Output, shape: tuple[int, int]) -> Values:
    """Return the log-odds of road of each plane of an opinion, ``(P, h, w)`` float32.

    A mask without such planes gives the signed distance to its edge in pixels of the working image,
    positive inside. ``shape`` is the working image's height and width.
    """
    size = shape[::-1]
    if codes := _probabilities(opinion):
        small = [cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in codes]
        share = np.stack(small).astype(np.float32) * SURE
        return np.log((share + SURE) / (1 - share + SURE))
    assert opinion.mask is not None
    mask = cv2.resize(opinion.mask.pixels(), size, interpolation=cv2.INTER_NEAREST_EXACT)
    inside, outside = (
        cv2.distanceTransform(side, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for side in (mask, 1 - mask)
    )
    return np.clip(inside - outside, -max(size), max(size))[None]


def sample_features(
    sample: TrainingSet, see: Callable[[Rgb, Output | None], tuple[Scene, Values]]
) -> tuple[Values, Values]:
    """Return the features of the sampled pixels, and of the same pixels in the mirrored images.

    A road does not depend on the side of traffic: the mirror doubles the training pixels. Both are
    ``(n, F)`` float32, in the sample's order. ``see`` takes an image and the opinion on it, and
    returns the scene and the features, ``(F, h, w)``.
    """

    def at(image: Rgb, opinion: Output | None, row: Places, column: Places) -> Values:
        _, planes = see(image, opinion)
        _, height, width = planes.shape
        return planes[:, row * height // image.shape[0], column * width // image.shape[1]].T

    parts = []
    heard = sample.opinions or (None,) * len(sample.images)
    for index, (image, opinion) in enumerate(zip(sample.images, heard, strict=True)):
        here = np.flatnonzero(sample.frame == index)
        row, column = sample.row[here], sample.column[here]
        flipped = opinion
        if opinion is not None and opinion.mask is not None:
            mask = Packed.of(opinion.mask.pixels()[:, ::-1])
            planes = (np.ascontiguousarray(p[:, ::-1]) for p in _probabilities(opinion))
            flipped = Output(mask=mask, by_class=tuple(planes))
        mirror = np.ascontiguousarray(image[:, ::-1])
        opposite = at(mirror, flipped, row, image.shape[1] - 1 - column)
        parts.append((here, at(image, opinion, row, column), opposite))
    order, straight, mirrored = map(np.concatenate, zip(*parts, strict=True))
    back = np.argsort(order)
    return straight[back], mirrored[back]


SUNLIT: Final = 80
"""Percentile of the lower half's log brightness that is about sunlit ground."""
SHADE, SUN = -0.8, -0.3
"""Natural logarithms of brightness over that percentile: at or below `SHADE` a pixel counts as
shade, at or above `SUN` as lit."""
LIGHT: Final = f"light.light_over_{SUNLIT}th_percentile"
"""Name of the feature that is the light of a pixel."""


def light_share(bright: Values) -> Values:
    """Return the share s of light, which grows from 0 at `SHADE` to 1 at `SUN`.

    ``bright`` is the feature `LIGHT`, float32 of any shape.
    """
    return np.clip((bright - SHADE) / (SUN - SHADE), 0, 1)


def beyond(far: Values, bright: Values) -> Values:
    """Compute ``s max(d - 1, 0)``: how far a pixel lies beyond the road's end, times its light.

    A shadow's edge lengthens the paths into it, so that in the shade the distance says little. All
    are ``(h, w)`` float32; d is `reach`, s `light_share`, ``bright`` the feature `LIGHT`.
    """
    return light_share(bright) * np.maximum(far - 1, 0)
