"""Gates that tell a shadow on the road from everything else: candidates, components, rings.

Steps 1 to 3 of the gated filter (`gated`), all on its working image. Each gate is a setting, and a
component that does not pass one is rejected for that reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.data import LabelClass, Mask, Rgb, colours
from roadeval.data.arrays import Floats, Labels
from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond import road_light
from roadeval.pipeline.beyond.road_light import RoadLight
from roadeval.pipeline.channels import split
from roadeval.pipeline.paper.shadow import RING_COLOUR, SHADOW_COLOUR
from roadeval.pipeline.reference_patch import Share

Pixels = Annotated[int, Field(ge=0, le=64)]

VERDICTS: Final = (
    LabelClass(0, "none", colours.CLEAR),
    LabelClass(1, "accepted", SHADOW_COLOUR),
    LabelClass(2, "too small", colours.with_opacity(colours.GREY, 200)),
    LabelClass(3, "too far away", colours.with_opacity(colours.ORANGE, 200)),
    LabelClass(4, "no lit road around it", RING_COLOUR),
    LabelClass(5, "too dark for shade", colours.with_opacity(colours.BLACK, 200)),
    LabelClass(6, "too bright for shade", (255, 255, 255, 200)),
    LabelClass(7, "rougher than road", colours.with_opacity(colours.VERMILLION, 200)),
    LabelClass(8, "too little in the frame", colours.with_opacity(colours.PURPLE, 200)),
)
ACCEPTED, SMALL, FAR, ALONE, DARK, BRIGHT, ROUGH, LITTLE = range(1, len(VERDICTS))


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class GatedSettings:
    """Settings of the gated filter. Lengths and areas are in pixels of the working image.

    Parameters
    ----------
    width
        Of the working image: wider ones are reduced to it for all that is decided. Texture and
        penumbra then mean the same for every camera, and the time is the same too.
    horizon
        Above this share of the height nothing is a candidate: sky, trees and houses are there.
    colour_distance
        Greatest Mahalanobis distance of a candidate's log-chromaticity to the segment from lit to
        shaded road, and of a lit pixel's to lit road. 3 holds 99 % of a normal cloud.
    max_green
        Greatest excess green of either: grass in the shade has nearly the road's colour.
    min_level
        Candidates and lit road are brighter than this grey level (0..255): below it a colour is
        noise.
    max_level
        Lit road is darker than this grey level: white cars and glare have the road's colour too.
    lit_quantile
        The frame's sunlit level is this quantile of the brightness of all pixels of lit road's
        colour: few enough to be lit in a frame that is mostly in the shade.
    darkness
        Candidates are darker than this share of the sunlit level, rings brighter.
    min_core
        Pixels of a component that lie ``CORE`` pixels from its edge: fewer can be judged neither
        in brightness nor in texture.
    reach
        A component's lowest pixel lies below this share of the height. What is wholly further away
        is a few pixels of parked cars and hedges as often as shade.
    gap, ring_width
        Rings begin so far from the component, beyond its penumbra, and are so wide.
    min_ring
        Pixels of lit road in the ring: a shadow on the road has road beside it.
    ratio
        Least and greatest brightness of the component relative to its ring. Darker is an opening
        or a car's underside, brighter another pavement. One over the least bounds the gain.
    max_texture
        Greatest root mean square of the log brightness about its 5x5 mean, in the core. Shade
        leaves a road's texture as it is, and roads are smooth; leaves, cars and house fronts are
        not.
    min_share
        Share of the frame that all components which pass the other gates must cover together.
        Under a clouded sky it is still dark beneath cars, and nowhere else.
    softness
        Side of the square that the gains are averaged over, so that edges stay soft.
    """

    width: Annotated[int, Field(ge=32, le=4096)] = 320
    horizon: Share = 0.35
    colour_distance: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 3.0
    max_green: Annotated[float, Field(allow_inf_nan=False)] = 0.08
    min_level: Annotated[float, Field(ge=0, le=255)] = 4.0
    max_level: Annotated[float, Field(ge=0, le=255)] = 235.0
    lit_quantile: Share = 0.8
    darkness: Share = 0.55
    min_core: Annotated[int, Field(ge=1)] = 10
    reach: Share = 0.6
    gap: Pixels = 2
    ring_width: Annotated[int, Field(ge=1, le=64)] = 6
    min_ring: Annotated[int, Field(ge=1)] = 20
    ratio: tuple[Share, Share] = (0.12, 0.75)
    max_texture: Annotated[float, Field(ge=0)] = 0.12
    min_share: Share = 0.02
    softness: Annotated[int, Field(ge=1, le=99)] = 5

    @model_validator(mode="after")
    def _ordered(self) -> GatedSettings:
        if not 0 < self.ratio[0] < self.ratio[1]:
            raise ValueError("ratio must be two shares above 0, the lower one first")
        return self


CORE: Final = 2
"""Pixels from a component's edge to its core: the edge itself is no texture."""


# --- Candidates -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class GatedImage:
    """A working image as the gates see it.

    Parameters
    ----------
    image
        ``(h, w, 3)`` uint8 RGB.
    total
        ``(h, w)`` uint16, ``R + G + B``.
    candidates, lit
        ``(h, w)`` uint8: dark pixels, and bright ones, of the road's colours.
    """

    image: Rgb
    total: npt.NDArray[np.uint16]
    candidates: Mask
    lit: Mask


def look(image: Rgb, road: RoadLight, settings: GatedSettings) -> GatedImage:
    """Find the candidates and the lit road of an ``(h, w, 3)`` uint8 RGB image."""
    total = road_light.brightness(image)
    like = road_light.likeness(image, road)
    possible = road_light.excess_green(image, total) < settings.max_green
    possible &= total > 3 * settings.min_level
    possible[: round(settings.horizon * len(image))] = False
    near = np.float32(settings.colour_distance**2)
    lit = possible & (like.lit < near)
    limit = settings.darkness * road_light.quantile(
        total, lit.view(np.uint8), settings.lit_quantile
    )
    dark = (possible & (like.shaded < near) & (total < limit)).view(np.uint8)
    square = np.ones((3, 3), np.uint8)
    dark = cv2.morphologyEx(cv2.morphologyEx(dark, cv2.MORPH_OPEN, square), cv2.MORPH_CLOSE, square)
    lit &= (total >= limit) & (total < 3 * settings.max_level)
    return GatedImage(image, total, dark, lit.view(np.uint8))


# --- Components and rings -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredComponents:
    """The measurements of each component; entry 0 is the background.

    Parameters
    ----------
    labels, rings
        ``(h, w)`` int32: the component that a pixel belongs to, and the one whose ring it is in.
    area, core, ring
        ``(count,)``: pixels of the component, of its core and of its ring.
    lowest
        ``(count,)``: the component's lowest row, as a share of the height.
    ratio
        ``(count, 3)``: mean of the core over mean of the ring, each channel apart; 1 if unknown.
    texture
        ``(count,)``: root mean square of the core's log brightness about its 5x5 mean.
    """

    labels: Labels
    rings: Labels
    area: npt.NDArray[np.int64]
    core: npt.NDArray[np.int64]
    ring: npt.NDArray[np.int64]
    lowest: Floats
    ratio: Floats
    texture: Floats


def components(scene: GatedImage, settings: GatedSettings) -> MeasuredComponents:
    """Label the candidates (Eq. 9) and measure each component against its ring (Eq. 10)."""
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(scene.candidates)
    core = np.where(eroded(scene.candidates, CORE), labels, 0)
    rings = _rings(scene, labels, settings)
    inside, around = (_sums(scene.image, part, count) for part in (core, rings))
    known = (inside[:, 0] > 0) & (around[:, 0] > 0)
    means = [part[:, 1:4] / np.maximum(part[:, :1], 1) + 1e-3 for part in (inside, around)]
    ratio = np.where(known[:, None], means[0] / means[1], 1.0)
    bottom = boxes[:, cv2.CC_STAT_TOP] + boxes[:, cv2.CC_STAT_HEIGHT] - 1
    texture = _texture(scene.total, core, count)
    sizes = (boxes[:, cv2.CC_STAT_AREA].astype(np.int64), inside[:, 0], around[:, 0])
    return MeasuredComponents(labels, rings, *sizes, bottom / len(labels), ratio, texture)


def eroded(mask: Mask, pixels: int) -> npt.NDArray[np.bool_]:
    """Keep what lies more than so many pixels from the mask's outside, ``(h, w)`` bool."""
    side = 2 * pixels + 1
    square = np.ones((side, side), np.uint8)
    inner: Mask = cv2.erode(mask, square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return inner > 0


def _rings(scene: GatedImage, labels: Labels, settings: GatedSettings) -> Labels:
    """Assign each pixel of lit road at a ring's distance to the component nearest to it."""
    distance, nearest = cv2.distanceTransformWithLabels(
        1 - scene.candidates, cv2.DIST_C, 5, labelType=cv2.DIST_LABEL_CCOMP
    )
    # OpenCV's distance transform numbers the components in another order.
    own = np.zeros(nearest.max() + 1, np.int32)
    inside = labels > 0
    own[nearest[inside]] = labels[inside]
    within = (distance > settings.gap) & (distance <= settings.gap + settings.ring_width)
    rings: Labels = np.where(within & (scene.lit > 0), own[nearest], 0)
    return rings


def _sums(image: Rgb, labels: Labels, count: int) -> npt.NDArray[np.int64]:
    """Return pixels and sums of R, G, B by label, ``(count, 7)``, see `kernels.plain.run_sums`."""
    return KERNELS.run_sums(split(image), KERNELS.label_runs(labels), count)


_LOG_TOTAL: Final = np.log(np.arange(3 * 255 + 1) / 3 + 4).astype(np.float32)


def _texture(total: npt.NDArray[np.uint16], core: Labels, count: int) -> Floats:
    logs = _LOG_TOTAL[total]
    rough = (logs - cv2.blur(logs, (5, 5))) ** 2
    here = core > 0
    n = np.bincount(core[here], minlength=count)
    return np.sqrt(np.bincount(core[here], rough[here], count) / np.maximum(n, 1))


def judge(found: MeasuredComponents, settings: GatedSettings) -> npt.NDArray[np.uint8]:
    """Return the verdict on each component: ``(count,)`` uint8, a value of `VERDICTS`.

    The first gate that it does not pass is the reason; the background is 0.
    """
    brightness = found.ratio.mean(axis=1)
    low, high = settings.ratio
    verdicts = np.select(
        [
            found.core < settings.min_core,
            found.lowest < settings.reach,
            found.ring < settings.min_ring,
            brightness < low,
            brightness > high,
            found.texture > settings.max_texture,
        ],
        [SMALL, FAR, ALONE, DARK, BRIGHT, ROUGH],
        ACCEPTED,
    ).astype(np.uint8)
    verdicts[0] = 0
    accepted = verdicts == ACCEPTED
    if found.area[accepted].sum() < settings.min_share * found.labels.size:
        verdicts[accepted] = LITTLE
    return verdicts
