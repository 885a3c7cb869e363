"""Features of a pixel of the ground, in groups: each is one idea of what tells road from the rest.

A group is a function of the `Scene`, in `GROUPS`. It returns its features by name, each ``(h, w)``
float32 or what NumPy spreads to that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import CERTAIN, Mask, Rgb
from roadeval.data.arrays import Values
from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond.scene import Scene, mean, slopes_of, steepness, tones_of
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.stage import Opinion, TrainingSet

Places = npt.NDArray[np.intp]
Named = Mapping[str, Values]
"""Features by name."""

TONES: Final = ("light", "red_green", "blue_green")
"""Names of the tones."""

ANGLES: Final = (30, 45, 60)
"""Of the projections, in degrees from ``ln R - ln G`` towards ``ln B - ln G``."""
SMOOTH: Final = 7
"""Side of the square over which the distance to the patch is averaged."""
PERCENTILES: Final = (50, 80)
"""Of the log brightness in the lower half."""
TEXTURES: Final = (3, 9, 21)
"""Sides of the squares over which slopes are averaged."""
DEVIATION: Final = 9
"""Side of the square in which the log brightness deviates."""
WINDOWS: Final = (7, 19, 41)
"""Sides of the squares over which tones are averaged; the first is what is held against others."""
OFFSETS: Final = ((-14, 0), (14, 0), (28, 0), (-28, 0), (0, 20), (0, -20))
"""Columns and rows to those others. Beyond the border lies what lies there."""
_ACROSS, _DOWN = (max(abs(offset[way]) for offset in OFFSETS) for way in (0, 1))


def colour(scene: Scene) -> Named:
    """Return red, green, blue, the tones, their projections, and the distances to the patch.

    A projection of the log-chromaticities on one direction keeps what a change between sunlight and
    skylight leaves alone. Which direction that is depends on the camera (Alvarez and Lopez 2011),
    so there are three.
    """
    _, red, blue = scene.tones
    _, own_red, own_blue = scene.middle
    channels = np.moveaxis(scene.image.astype(np.float32), 2, 0)
    found = dict(zip(("red", "green", "blue"), channels, strict=True))
    found |= zip(TONES, scene.tones, strict=True)
    for angle in ANGLES:
        first, second = (np.float32(each(np.radians(angle))) for each in (np.cos, np.sin))
        found[f"projection_{angle}"] = (red - own_red) * first + (blue - own_blue) * second
    return {
        **found,
        "colour_distance": scene.colour,
        "hue_distance": scene.hue,
        "colour_distance_around": mean(scene.colour, SMOOTH),
    }


def light(scene: Scene) -> Named:
    """Return log brightness less the lower half's, and the row's; and the row's median colour.

    A second exposure that does not trust the patch: where that lies in the shade of a lorry, the
    sunlit road is too bright for it, but not for the lower half of the image.
    """
    own = scene.tones[0]
    return {
        **light_over(scene, *PERCENTILES),
        "light_over_row": own - own.mean(axis=1, keepdims=True),
        "colour_distance_of_row": np.median(scene.colour, axis=1, keepdims=True),
    }


def light_over(scene: Scene, *percentiles: int) -> Named:
    """Return log brightness less each percentile of the lower half's, ``(h, w)`` float32."""
    light = scene.tones[0]
    levels = np.percentile(light[scene.shape[0] // 2 :], percentiles)
    return {
        f"light_over_{each}th_percentile": light - np.float32(level)
        for each, level in zip(percentiles, levels, strict=True)
    }


def place(scene: Scene) -> Named:
    """Return column (-1 to 1), its magnitude, and row (0 to 1) of each pixel's centre."""
    height, width = scene.shape
    across = (np.arange(width, dtype=np.float32) + np.float32(0.5)) * np.float32(2 / width) - 1
    down = (np.arange(height, dtype=np.float32) + np.float32(0.5)) / np.float32(height)
    return {"across": across[None], "from_middle": np.abs(across)[None], "down": down[:, None]}


def texture(scene: Scene) -> Named:
    """Return the root of the mean absolute slope of the log brightness, and its deviation.

    In each window across and down: kerbs, wheels and house fronts have edges of one direction,
    leaves of both.
    """
    slopes = {"across": np.abs(scene.slopes[0]), "down": np.abs(scene.slopes[1])}
    own = scene.tones[0]
    variance = mean(own * own, DEVIATION) - np.square(mean(own, DEVIATION))
    return {
        **{f"{w}_{side}": np.sqrt(mean(slopes[w], side)) for side in TEXTURES for w in slopes},
        "deviation": np.sqrt(np.maximum(variance, 0)),
    }


def surroundings(scene: Scene) -> Named:
    """Return means of tones, and differences of means of light, blue-green and colour distance."""
    named = dict(zip(TONES, scene.tones, strict=True))
    found = {f"{tone}_{side}": mean(named[tone], side) for side in WINDOWS for tone in TONES}
    compared = {tone: found[f"{tone}_{WINDOWS[0]}"] for tone in ("light", "blue_green")}
    compared["colour_distance"] = mean(scene.colour, WINDOWS[0])
    height, width = scene.shape
    for name, plane in compared.items():
        wide = cv2.copyMakeBorder(plane, *(_DOWN,) * 2, *(_ACROSS,) * 2, cv2.BORDER_REPLICATE)
        for across, down in OFFSETS:
            there = wide[_DOWN + down :, _ACROSS + across :][:height, :width]
            found[f"{name}_to_{across}_{down}"] = plane - there
    return found


def scans(scene: Scene) -> Named:
    """Return what `_column` finds below and above, and what is met from the middle outwards.

    In a row these are the root of the steepest slope across, and the furthest hue. Whoever drives
    up the column to the pixel meets no kerb and no shadow under a car as long as there is road.
    """
    steep = cv2.blur(np.abs(scene.slopes[0]), (3, 5))
    columns = {
        f"{name}_{way}": plane
        for way, step in (("below", -1), ("above", 1))
        for name, plane in _column(scene, step).items()
    }
    inside = {"edge_inside": np.sqrt(steep), "hue_inside": mean(scene.hue, 3)}
    return columns | {name: outwards(plane) for name, plane in inside.items()}


def _column(scene: Scene, step: int) -> Named:
    """Return what is met along each column until a pixel is reached, from below (-1) or above (1).

    The root of the steepest slope down, the least and the greatest log brightness, the mean
    distance of colours to the patch, the greatest of hues, and the sum of edges.
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


def outwards(plane: Values) -> Values:
    """Return the greatest value met along a row from the image's middle to each pixel."""
    half = plane.shape[1] // 2
    found = np.empty_like(plane)
    np.maximum.accumulate(plane[:, half:], axis=1, out=found[:, half:])
    left = np.s_[:, half - 1 :: -1] if half else np.s_[:, :0]
    found[left] = np.maximum.accumulate(plane[left], axis=1)
    return found


ROUNDS: Final = 3
"""Sweeps up and down. More would shorten the path to about one pixel in a hundred by 1 %."""
SCALE: Final = 10_000
"""Of costs as whole numbers: the least has two digits."""
LENGTH: Final = 10 * SCALE
"""Of a straight step of cost 1, see `roadeval.kernels.plain`."""
FLOOR: Final = 0.005
"""Cost of a step on the smoothest ground, so that a longer path costs more."""
GREATEST: Final = 6.5
"""Cost of a step over the hardest, which fits in 16 bit."""


def paths(scene: Scene) -> Named:
    """Return the geodesic distances over edges, over edges and hues, and over colours.

    A kerb, a line of parked cars or a change of colour is crossed by every path from the ground in
    front of the vehicle to what lies behind it, and the cheapest path goes around a mark, a shadow
    or a drain. So the distance is small on the road wherever it leads, and grows by a step at its
    edge. With the gradient g of the log brightness a pixel, and the distances h of hues and d of
    colours to the patch in its deviations, the costs of a pixel are ``g``,
    ``g / 2 + min(h, 10) / 20`` and ``0.03 min(d, 15)``.
    """
    hue: Values = np.float32(1 / 20) * np.minimum(scene.hue, np.float32(10))
    far: Values = np.float32(0.03) * np.minimum(scene.colour, np.float32(15))
    edge: Values = np.float32(1 / 2) * scene.edge
    costs = {"over_edges": scene.edge, "over_edges_and_hues": edge + hue, "over_colours": far}
    return {name: distance(cost, scene.patch) for name, cost in costs.items()}


def distance(cost: Values, patch: Mask) -> Values:
    """Return the geodesic distance of each pixel from a patch, in pixels.

    It is ``min over paths of the integral of 0.005 + c`` (Toivanen 1996, see
    `roadeval.kernels.plain`) for a cost c of each pixel, ``(h, w)`` float32, of which
    what is beyond `GREATEST` does not count.
    """
    whole = np.minimum(cost + np.float32(FLOOR), np.float32(GREATEST)) * np.float32(SCALE)
    found = KERNELS.geodesics(np.rint(whole).astype(np.uint16), patch, ROUNDS).astype(np.float32)
    lengths: Values = found / np.float32(LENGTH)
    return lengths


THIN, WIDE = 3, 15
"""Sides of the squares whose means differ where there is a thin line."""
SURROUNDINGS: Final = 31
"""Side of the square that an edge is held against: on a smooth pavement a low kerb is steep."""
FAINT: Final = 0.02
"""Added to that square's mean edge: noise is no edge."""
WEIGHTS: Final = {"edge": 1.0, "relative_edge": 0.05, "hue_edge": 1.0, "yellow": 1.0, "dark": 1.0}
"""What each adds to the cost of a path."""
SQUARED: Final = {"edge": 20.0, "relative_edge": 0.05}
"""Weights of squared barriers in the costs of further paths. These go a long way through what is
faint before they cross anything steep: around the end of a kerb, not over it."""


def barriers(scene: Scene) -> Named:
    """Return each barrier at a pixel, on its path from the patch, and from the middle outwards.

    Kerbs, seams, yellow and dark lines; the greatest of each four pixels is kept, so that a line of
    one pixel is not averaged away. The distances over the squares of `SQUARED` come last. Each is
    ``(h, w)`` float32; distances are those of `distance`, in pixels.
    """
    fine = zip(WEIGHTS, barriers_of(tones_of(scene.fine)), strict=True)
    found = {name: greatest_of_four(plane) for name, plane in fine}
    far = partial(distance, patch=scene.patch)
    return {
        **found,
        **{f"over_{name}": far(found[name] * np.float32(w)) for name, w in WEIGHTS.items()},
        **{f"{name}_inside": outwards(plane) for name, plane in found.items()},
        **{
            f"around_{name}": far(np.square(found[name]) * np.float32(w))
            for name, w in SQUARED.items()
        },
    }


def barriers_of(tones: tuple[Values, Values, Values]) -> list[Values]:
    """Return the barriers of tones at twice the size, in the order of `WEIGHTS`.

    The gradient of the log brightness; the same held against its surroundings; the sum of the
    chromaticities' gradients; and how much a thin line is yellower, ``(ln R + ln G) / 2 - ln B``,
    or darker than what surrounds it.
    """
    bright, red, blue = tones
    edge = steepness(slopes_of(bright))
    hues: Values = steepness(slopes_of(red)) + steepness(slopes_of(blue))
    yellow: Values = np.float32(1 / 2) * red - blue
    return [
        edge,
        edge / (mean(edge, SURROUNDINGS) + np.float32(FAINT)),
        hues,
        np.maximum(mean(yellow, THIN) - mean(yellow, WIDE), 0),
        np.maximum(mean(bright, WIDE) - mean(bright, THIN), 0),
    ]


def greatest_of_four(plane: Values) -> Values:
    """Return the greatest of each four pixels of a ``(2 h, 2 w)`` image, ``(h, w)``."""
    rows = np.maximum(plane[::2], plane[1::2])
    return np.maximum(rows[:, ::2], rows[:, 1::2])


GROUPS: Final[Mapping[str, Callable[[Scene], Named]]] = {
    each.__name__: each
    for each in (barriers, colour, light, paths, place, scans, surroundings, texture)
}


@cache
def names_of(groups: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the features of some groups, with the group's before them."""
    grey = np.full((24, 32, 3), 128, np.uint8)
    scene = Scene.of(grey, cv2.resize(grey, (64, 48)), ReferencePatch())
    return tuple(f"{group}.{name}" for group in groups for name in GROUPS[group](scene))


def features(scene: Scene, groups: tuple[str, ...]) -> Values:
    """Compute the features of some groups, ``(F, h, w)`` float32 in the order of `names_of`."""
    found: Values = np.empty((len(names_of(groups)), *scene.shape), np.float32)
    planes = (plane for name in groups for plane in GROUPS[name](scene).values())
    for place_, plane in zip(found, planes, strict=True):
        place_[...] = plane
    return found


SURE: Final = np.float32(1 / CERTAIN)
"""The probability nearest to 0 or 1 that a log-odds is computed of."""


def opinions(opinion: Opinion, shape: tuple[int, int]) -> Values:
    """Return the log-odds of road of each plane of an opinion, ``(P, h, w)`` float32.

    Of a mask without any it is the signed distance to the mask's edge in pixels of the working
    image, positive inside. ``shape`` is the working image's height and width.
    """
    size = shape[::-1]
    if not opinion.planes:
        mask = cv2.resize(opinion.mask.pixels(), size, interpolation=cv2.INTER_NEAREST_EXACT)
        inside, outside = (
            cv2.distanceTransform(side, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            for side in (mask, 1 - mask)
        )
        signed: Values = np.clip(inside - outside, -max(size), max(size))[None]
        return signed
    planes = [cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in opinion.planes]
    share = np.stack(planes).astype(np.float32) * SURE
    odds: Values = np.log((share + SURE) / (np.float32(1) - share + SURE))
    return odds


def at_samples(
    sample: TrainingSet, see: Callable[[Rgb, Opinion | None], tuple[Scene, Values]]
) -> tuple[Values, Values]:
    """Return the features of the sampled pixels, and of the same in the mirrored images.

    Nothing but habit makes traffic keep to one side: the mirror doubles what there is to learn
    from. Both are ``(n, F)`` float32, in the sample's order; ``see`` returns the scene of an image
    and what is said of it, and the features, ``(F, h, w)``.
    """
    order, straight, mirrored = [], [], []
    heard = sample.opinions or (None,) * len(sample.images)
    for index, (image, opinion) in enumerate(zip(sample.images, heard, strict=True)):
        here = np.flatnonzero(sample.frame == index)
        row, column = sample.row[here], sample.column[here]
        flipped = np.ascontiguousarray(image[:, ::-1])
        order.append(here)
        straight.append(_at(see(image, opinion)[1], image, row, column))
        opposite = None if opinion is None else opinion.mirrored()
        mirrored.append(_at(see(flipped, opposite)[1], image, row, image.shape[1] - 1 - column))
    back = np.argsort(np.concatenate(order))
    return np.concatenate(straight)[back], np.concatenate(mirrored)[back]


def _at(planes: Values, image: Rgb, row: Places, column: Places) -> Values:
    """Return the features ``(n, F)`` of some of the image's pixels."""
    _, height, width = planes.shape
    rows, columns = row * height // image.shape[0], column * width // image.shape[1]
    found: Values = planes[:, rows, columns].T
    return found


OVER_EDGES: Final = 1.0
"""Where roads end by the distance over the edges of the working image, which grows with all that is
crossed."""
AROUND_EDGES: Final = 1.5
"""And by that over the squared edges of the image at twice its size, which grows where something
steep is, thin kerbs included. Both values are the best, or next to it, on the train part of IDD
Lite, on CamVid 0016E5 and 0006R0 and a synthetic drive; for working images of 160 columns, made of
320 or more: edges of smaller images are blurred, and more is reached. They hold after the stage
`exposure`, which weakens edges among what is brighter than the patch."""
SUNLIT: Final = 80
"""Of the lower half's log brightness: about that of sunlit ground."""
SHADE, SUN = -0.8, -0.3
"""Of the natural logarithm of brightness over that percentile: at or below `SHADE` a pixel counts
as shade, at or above `SUN` as lit."""
REACH: Final = (
    "paths.over_edges",
    "barriers.around_edge",
    f"light.light_over_{SUNLIT}th_percentile",
)
"""The features that are the two distances and the light of a pixel."""


def reach(scene: Scene) -> Values:
    """Return how far each pixel lies from the patch, ``(h, w)`` float32; roads end at about 1.

    Edges of brightness are what makes a way long. It needs no training, and most roads end at about
    the same value, whatever the camera. Hue does not count: a verge as bright as the road is
    reached.
    """
    return combined(*reach_inputs(scene)[:2])


def reach_inputs(scene: Scene) -> Sequence[Values]:
    """Compute the planes of `REACH`, ``(h, w)`` float32 each."""
    edge, *_ = barriers_of(tones_of(scene.fine))
    steep = np.square(greatest_of_four(edge)) * np.float32(SQUARED["edge"])
    over = (distance(cost, scene.patch) for cost in (scene.edge, steep))
    return *over, *light_over(scene, SUNLIT).values()


def combined(over: Values, around: Values) -> Values:
    """Compute ``d = (over / OVER_EDGES + around / AROUND_EDGES) / 2``, ``(h, w)`` float32, no unit.

    Both are ``(h, w)`` float32: the distances of `REACH`, in that order.
    """
    middle: Values = np.float32(1 / 2) * (
        over / np.float32(OVER_EDGES) + around / np.float32(AROUND_EDGES)
    )
    return middle


def lit(bright: Values) -> Values:
    """Return the share s of light, which grows from 0 at `SHADE` to 1 at `SUN`.

    ``bright`` is the last of `REACH`, float32 of any shape.
    """
    share: Values = np.clip((bright - np.float32(SHADE)) / np.float32(SUN - SHADE), 0, 1)
    return share


def beyond(far: Values, bright: Values) -> Values:
    """Compute ``s max(d - 1, 0)``: how far a pixel lies beyond the road's end, times its light.

    A shadow's edge lengthens the way into it, so that in the shade the distance says little. All
    are ``(h, w)`` float32; d is `combined`, s `lit`, ``bright`` the last of `REACH`.
    """
    past: Values = lit(bright) * np.maximum(far - np.float32(1), 0)
    return past
