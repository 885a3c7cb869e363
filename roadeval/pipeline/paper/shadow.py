"""Phase 2, the shadow filter (section 3.2): finds shadow and gives it the colours around it.

The steps are hue, saturation and value (Eq. 3-5), the mask by NDI and Otsu's threshold (Eq. 6-8),
components and buffer rings (Eq. 9-10), and their compensation (Eq. 11).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from roadeval.data import (
    Layer,
    LayerKind,
    LayerSpec,
    Mask,
    Packed,
    Rgb,
    Truth,
    colours,
    everywhere,
    mask_spec,
)
from roadeval.data.arrays import Floats, Labels, Plane, Runs, Sums
from roadeval.kernels import KERNELS
from roadeval.kernels.plain import paint, ring_pairs
from roadeval.pipeline.stage import Output, Stage, View, per_view, stage_settings

SHADOW_COLOUR: Final = (*colours.SHADOW, 160)
RING_COLOUR: Final = (*colours.RING, 220)

NDI: Final = LayerSpec(
    "ndi", LayerKind.SCALAR, "NDI (Eq. 6)", value_range=(-1.0, 1.0), photographic=True
)
SHADOW: Final = mask_spec("shadow", "Shadow mask (Eq. 8)", lit=colours.CLEAR, shadow=SHADOW_COLOUR)
RINGS: Final = mask_spec(
    "rings",
    "Components and buffer rings (Eq. 9-10)",
    none=colours.CLEAR,
    shadow=SHADOW_COLOUR,
    ring=RING_COLOUR,
)
COMPENSATED: Final = LayerSpec(
    "compensated", LayerKind.RGB, "Compensated image (Eq. 11)", exact=False
)


@stage_settings
class ShadowSettings:
    """Settings of the shadow filter.

    threshold: ``otsu``: the between-class variance of Otsu (1979); ``printed``: Eq. 7 with the
        definitions printed beside it, which lands at the edge of the histogram.
    inclusive: Whether the code of the threshold itself is shadow, as printed in Eq. 8. Otsu's upper
        class begins above it.
    connectivity: Number of neighbours of a pixel in a component (Eq. 9): 8 or 4.
    ring_width: Number of 3x3 dilations that make a buffer ring (Eq. 10), at most 16: the work grows
        with its square.
    max_gain: Upper bound of the contrast gain of Eq. 11; none as printed. Gains above 3 are common.
    statistic: ``deviation``: ``mu_ring + (I - mu) * sigma_ring / sigma``, which gives the component
        its ring's mean and standard deviation; ``printed``: Eq. 11 literally, variances and
        inverted.
    colour_space: Colour space of the compensation: ``rgb``, or ``hsi`` (S and V of Eq. 3-5, hue
        unchanged, converted back by step 5 of section 4.2).
    """

    threshold: Literal["otsu", "printed"] = "otsu"
    inclusive: bool = False
    connectivity: Literal[4, 8] = 8
    ring_width: Annotated[int, Field(ge=1, le=16)] = 1
    max_gain: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    statistic: Literal["deviation", "printed"] = "deviation"
    colour_space: Literal["rgb", "hsi"] = "rgb"


def value(rgb: Plane) -> Floats:
    """Return V of ``(..., 3)`` uint8 RGB: ``(R + G + B) / 3`` over 255, in 0..1 (Eq. 3)."""
    return rgb.sum(axis=-1, dtype=np.int64) / (3 * 255)


def saturation(rgb: Plane) -> Floats:
    """Return S of ``(..., 3)`` uint8 RGB: ``1 - 3 min / (R + G + B)``, 0 for black (Eq. 4)."""
    total = rgb.sum(axis=-1, dtype=np.int64)
    low = rgb.min(axis=-1).astype(np.int64)
    return np.where(total > 0, 1.0 - 3.0 * low / np.maximum(total, 1), 0.0)


def hue(rgb: Plane) -> Floats:
    """Return H of ``(..., 3)`` uint8 RGB in degrees, 0..360; 0 for greys (Eq. 5).

    The printed equation gives both branches the condition ``B <= G``; the second one,
    ``360 - theta``, holds for ``B > G``.
    """
    r, g, b = np.moveaxis(rgb.astype(np.float64), -1, 0)
    root = np.sqrt((r - g) ** 2 + (r - b) * (g - b))
    cosine = 0.5 * ((r - g) + (r - b)) / np.where(root > 0, root, 1.0)
    theta = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.where(root > 0, np.where(b <= g, theta, 360.0 - theta), 0.0)


def hsv_to_rgb(h: Floats, s: Floats, v: Floats) -> Plane:
    """Invert Eq. 3-5: ``(...,)`` degrees, 0..1, 0..1 to ``(..., 3)`` uint8 RGB, clipped.

    Within each third of the hue circle the least channel is ``V (1 - S)``, the leading one
    follows from the hue, and the last one from ``R + G + B = 3 V``.
    """
    third = np.floor(np.mod(h, 360.0) / 120.0).astype(np.int64) % 3
    angle = np.radians(np.mod(h, 120.0))
    least = v * (1.0 - s)
    leading = v * (1.0 + s * np.cos(angle) / np.cos(np.pi / 3.0 - angle))
    between = 3.0 * v - least - leading
    rgb = np.empty((*np.shape(h), 3))
    # Third 0 runs from red to green, 1 from green to blue, 2 from blue to red.
    for channel in range(3):
        place = (channel - third) % 3
        rgb[..., channel] = np.select([place == 0, place == 1], [leading, between], least)
    return np.clip(np.rint(rgb * 255.0), 0, 255).astype(np.uint8)


def ndi(saturation: Floats, value: Floats) -> Floats:
    """Compute the normalised difference index ``(S - V) / (S + V)`` in -1..1 (Eq. 6, section 3.2).

    The printed ``S - V / S - V`` lacks its brackets and a sign. ``S + V`` is 0 only for pure black,
    which gets -1 like every other grey, so that the border of a rectified image is not a shadow.
    """
    total = saturation + value
    return np.where(total > 0, (saturation - value) / np.where(total > 0, total, 1.0), -1.0)


def ndi_codes() -> Plane:
    """Return Eq. 6 by ``R + G + B`` and ``min(R, G, B)``, ``(766, 256)`` uint8.

    S and V, and so NDI, depend on these two alone. The codes are ``rint((NDI + 1) * 127.5)``.
    """
    total = np.arange(3 * 255 + 1, dtype=np.float64)[:, None]
    least = np.minimum(np.arange(256, dtype=np.float64)[None, :], np.floor(total / 3))
    # A common factor of S and V changes no NDI: times 765 (R + G + B) both are integers, and a
    # code halfway between two others, as for (R + G + B, min) = (85, 0), is rounded as one.
    index = ndi(3 * 255 * (total - 3.0 * least), total**2)
    return np.rint((index + 1.0) * 127.5).astype(np.uint8)


NDI_CODES: Final = ndi_codes()
_LEVELS: Final = np.arange(256)
"""j of Eq. 7."""


def otsu_threshold(histogram: Sums) -> int | None:
    """Return Otsu's threshold of a ``(256,)`` histogram (Eq. 7 as its source means it).

    It is the lowest T that maximises ``(mu_T w(T) - mu(T))^2 / (w(T) (1 - w(T)))``, with the weight
    ``w(T)`` and the first moment ``mu(T) = sum_{j<=T} j p_j`` of the lower class. The printed text
    defines ``mu(T)`` as the upper class's weight. None if only one code occurs.
    """
    lower, moment = histogram.cumsum(), (histogram * _LEVELS).cumsum()
    total = lower[-1]
    return _first_maximum(moment[-1] * lower - moment * total, lower * (total - lower))


def printed_threshold(histogram: Sums) -> int | None:
    """Return Eq. 7's threshold with the definitions printed beside it: ``mu(T) = sum_{j>T} p_j``.

    It is the lowest T that maximises ``(mu_T w(T) - mu(T))^2 / (w(T) mu(T))`` among those for which
    that is defined. None if only one code occurs.
    """
    lower, mean = histogram.cumsum(), (histogram * _LEVELS).sum()
    total = lower[-1]
    upper = total - lower
    return _first_maximum(mean * lower - upper * total, lower * upper)


def _first_maximum(difference: Sums, weights: Sums) -> int | None:
    """Return the lowest T of greatest ``difference^2 / weights`` among those with positive weights.

    Both criteria of Eq. 7 are multiplied by the squared number of pixels: difference and weights
    are then integers, and a code that no pixel has ties exactly with the code below it.
    """
    if not weights.any():
        return None
    criterion = difference.astype(np.float64) ** 2 / np.maximum(weights, 1)
    return int(np.argmax(np.where(weights > 0, criterion, -1.0)))


def shadow_mask(codes: Plane, threshold: int | None, *, inclusive: bool) -> Mask:
    """Return the mask of Eq. 8, ``(H, W)`` uint8: codes above ``threshold`` (or equal to it)."""
    if threshold is None:
        return np.zeros(codes.shape, np.uint8)
    return (codes >= threshold if inclusive else codes > threshold).view(np.uint8)


@dataclass(frozen=True, eq=False)
class Components:
    """Connected components of an image, numbered from 1."""

    runs: Runs
    """The runs of their rows, see `roadeval.kernels.plain.components`."""
    count: int
    shape: tuple[int, int]
    """Height and width of the image."""

    def labels(self) -> Labels:
        """Return their label image: ``(H, W)`` int32, 0 outside."""
        return paint(self.runs, *self.shape)


def connected_components(shadow: Packed, connectivity: int) -> Components:
    """Return the 4- or 8-connected components of a mask: Eq. 9's fixed point for every seed."""
    return Components(*KERNELS.components(shadow.bits, shadow.width, connectivity), shadow.shape)


def buffer_ring(shadow: Packed, width: int) -> Packed:
    """Return the union of all buffer rings (Eq. 10): ``width`` dilations of the shadow, less it."""
    reached = KERNELS.dilate(shadow.bits, np.full(width + 1, width), shadow.width)
    return Packed(reached & ~shadow.bits, shadow.width)


class Moments(NamedTuple):
    """Pixels ``(count,)``, means and population standard deviations ``(count, C)`` by label."""

    pixels: Sums
    mean: Floats
    deviation: Floats


def moments_of_sums(sums: Sums) -> Moments:
    """Return the moments by label of `roadeval.kernels.plain.run_sums`.

    The variance is taken about the grey level nearest to the mean, in integers: nothing cancels,
    a constant component has a deviation of exactly 0, and no component is too large.
    """
    # Whole numbers below 2^53, so that their products and differences are exact in float64.
    exact = sums.astype(np.float64)
    n, first, second = np.maximum(exact[:, :1], 1.0), exact[:, 1:4], exact[:, 4:]
    mean = first / n
    level = np.rint(mean)
    about = (first - n * level) / n
    variance = (second - level * (2.0 * first - n * level)) / n - about**2
    return Moments(sums[:, 0], mean, np.sqrt(variance))


def moments_of_values(labels: npt.NDArray[np.integer], values: Floats, count: int) -> Moments:
    """Return the moments by label of ``(n, C)`` values; a deviation below 1e-9 is 0."""
    pixels = np.bincount(labels, minlength=count)

    def mean(quantity: Floats) -> Floats:
        sums = [np.bincount(labels, column, count) for column in quantity.T]
        return np.stack(sums, axis=1) / np.maximum(pixels, 1)[:, None]

    centre = mean(values)
    deviation = np.sqrt(mean((values - centre[labels]) ** 2))
    return Moments(pixels, centre, np.where(deviation < 1e-9, 0.0, deviation))


def compensation(
    inside: Moments, ring: Moments, settings: ShadowSettings
) -> tuple[Floats, Floats, Floats]:
    """Compute the linear map of Eq. 11 for every component, each channel by itself.

    Returns source, target and gain of ``target + (I - source) * gain``, ``(count, C)`` each.
    ``deviation`` gives ``mu_ring + (I - mu) * sigma_ring / sigma`` (gain 1 if sigma is 0),
    after which the component has its ring's mean and deviation. ``printed`` gives
    ``mu_ring + (I - mu) / sigma_ring^2 * sigma^2`` (gain 1 if the ring's variance is 0),
    and flattens the region, since its ratio is upside down. Components without a ring stay
    unchanged.
    """
    above, below = ring.deviation, inside.deviation
    if settings.statistic == "printed":
        above, below = below**2, above**2
    gain = np.divide(above, below, out=np.ones_like(above), where=below > 0)
    if settings.max_gain is not None:
        gain = np.minimum(gain, settings.max_gain)
    here = ring.pixels[:, None] > 0
    here[0] = False
    return inside.mean, np.where(here, ring.mean, inside.mean), np.where(here, gain, 1.0)


def compensate(view: View, components: Components, ring: Packed, settings: ShadowSettings) -> Rgb:
    """Apply Eq. 11 to every component of a view's image.

    ``ring`` is the union of their buffer rings. Without a component the image itself is returned.
    """
    if not components.count:
        return view.image
    count, width = components.count + 1, settings.ring_width
    if settings.colour_space == "hsi":
        return compensate_hsi(view.image, components.labels(), ring, settings)
    inside = KERNELS.run_sums(view.planes, components.runs, count)
    around = KERNELS.ring_sums(view.planes, components.runs, ring.bits, count, width)
    linear = compensation(moments_of_sums(inside), moments_of_sums(around), settings)
    return KERNELS.transfer(view.image, components.runs, *linear)


def compensate_hsi(image: Rgb, labels: Labels, ring: Packed, settings: ShadowSettings) -> Rgb:
    """Compensate saturation and value, keep the hue, and convert back (section 4.2, step 5)."""
    result, flat = image.reshape(-1, 3).copy(), labels.ravel()
    shadow, count = np.flatnonzero(flat), int(flat.max()) + 1
    label, pixel = ring_pairs(labels, ring.pixels(), settings.ring_width)
    k, colour = flat[shadow], result[shadow]
    values = _saturation_value(colour)
    ring_values = _saturation_value(result[pixel])
    moments = moments_of_values(k, values, count), moments_of_values(label, ring_values, count)
    source, target, gain = compensation(*moments, settings)
    s, v = np.clip(target[k] + (values - source[k]) * gain[k], 0.0, 1.0).T
    # A component that is not compensated stays exactly the same: the conversion inverts any hsi.
    result[shadow] = hsv_to_rgb(hue(colour), s, v)
    return result.reshape(image.shape)


def _saturation_value(rgb: Plane) -> Floats:
    return np.stack([saturation(rgb), value(rgb)], axis=-1)


def lift(view: View, shadow: Packed, settings: ShadowSettings) -> tuple[Rgb, Packed]:
    """Compensate the shadow of a mask: components, rings, linear map (Eq. 9-11).

    Returns the image, and the rings.
    """
    components = connected_components(shadow, settings.connectivity)
    ring = buffer_ring(shadow, settings.ring_width)
    return compensate(view, components, ring, settings), ring


@per_view
def bind(settings: ShadowSettings, _learnt: None, view: View) -> Output:
    """Filter the image of a view."""
    threshold_of = otsu_threshold if settings.threshold == "otsu" else printed_threshold
    codes, histogram = KERNELS.look_up_sum_min(view.planes, NDI_CODES)
    threshold = threshold_of(histogram)
    mask = shadow_mask(codes, threshold, inclusive=settings.inclusive)
    shadow = Packed.of(mask)
    image, ring = lift(view, shadow, settings)
    lit = everywhere(shadow.shape) & ~(shadow.bits | ring.bits)
    return Output(
        layers=(
            Layer(NDI, codes),
            Layer(SHADOW, shadow),
            Layer(RINGS, mask + 2 * ring.pixels()),
            Layer(COMPENSATED, image),
        ),
        image=image,
        regions={"shadow": shadow, "shadow_edge": ring, "lit": Packed(lit, shadow.width)},
        facts={"threshold": math.nan if threshold is None else threshold / 127.5 - 1.0},
    )


def oracle(settings: ShadowSettings, _learnt: None, view: View, truth: Truth) -> Output:
    """Filter the true shadow with the same compensation."""
    return Output(image=lift(view, Packed.of(truth == 1), settings)[0])


STAGE: Final = Stage(
    name="shadow",
    title="Phase 2: shadow filter",
    settings=ShadowSettings,
    bind=bind,
    layers=(NDI, SHADOW, RINGS, COMPENSATED),
    is_filter=True,
    oracle=oracle,
)
