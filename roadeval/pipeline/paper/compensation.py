"""Compensation of shadow (section 3.2, Eq. 9-11): components, buffer rings, the linear map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Packed, Rgb
from roadeval.data.arrays import Floats, Labels, Runs
from roadeval.kernels import KERNELS
from roadeval.pipeline.paper import hsi
from roadeval.pipeline.paper.shadow_settings import ShadowSettings
from roadeval.pipeline.stage import View

# --- Regions: Eq. 9-10 ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Components:
    """Connected components of an image of ``shape`` (H, W), numbered from 1.

    ``runs`` is ``(n, 4)`` int32: row, first column, column after the last, and label of each of
    their rows' stretches. ``count`` is their number.
    """

    runs: Runs
    count: int
    shape: tuple[int, int]

    def labels(self) -> Labels:
        """Return their label image: ``(H, W)`` int32, 0 outside."""
        return KERNELS.paint(self.runs, *self.shape)


def connected_components(shadow: Packed, connectivity: int) -> Components:
    """Return the 4- or 8-connected components of a mask: Eq. 9's fixed point for every seed."""
    runs, count = KERNELS.components(shadow.bits, shadow.width, connectivity)
    return Components(runs, count, shadow.shape)


def buffer_ring(shadow: Packed, width: int) -> Packed:
    """Return the union of all buffer rings (Eq. 10): within ``width`` dilations, and not shadow."""
    reached = KERNELS.dilate(shadow.bits, np.full(width + 1, width), shadow.width)
    return Packed(reached & ~shadow.bits, shadow.width)


# --- Compensation: Eq. 11 -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Pixels ``(count,)``, means and population standard deviations ``(count, C)`` by label."""

    pixels: npt.NDArray[np.int64]
    mean: Floats
    deviation: Floats

    def __getitem__(self, labels: slice) -> Moments:
        """Return those of some of the labels."""
        return Moments(self.pixels[labels], self.mean[labels], self.deviation[labels])


@dataclass(frozen=True, slots=True, eq=False)
class Compensation:
    """The linear map of each component, ``target + (I - source) * gain``; ``(count, C)`` each.

    ``applied`` is ``(count,)`` bool: the components that have a ring and the least area. The
    others map to themselves.
    """

    source: Floats
    target: Floats
    gain: Floats
    applied: npt.NDArray[np.bool_]


def moments_of_sums(sums: npt.NDArray[np.int64]) -> Moments:
    """Moments by label from `roadeval.kernels.plain.run_sums`.

    The variance is taken about the grey level next to the mean, in integers: nothing cancels,
    a constant component has a deviation of exactly 0, and no component is too large.
    """
    # Whole numbers below 2^53, so that their products and differences are exact in float64. By
    # columns in memory, so that NumPy works on contiguous values.
    exact = sums.astype(np.float64, order="F")
    n, first, second = np.maximum(exact[:, :1], 1.0), exact[:, 1:4], exact[:, 4:]
    mean = first / n
    level = np.rint(mean)
    about = (first - n * level) / n
    variance = (second - level * (2.0 * first - n * level)) / n - about**2
    return Moments(sums[:, 0], mean, np.sqrt(variance))


def moments_of_values(labels: npt.NDArray[np.integer], values: Floats, count: int) -> Moments:
    """Moments by label of ``(n, C)`` values, in two passes; below 1e-9 a deviation is 0."""
    pixels = np.bincount(labels, minlength=count)
    n = np.maximum(pixels, 1)[:, None]

    def mean(quantity: Floats) -> Floats:
        columns = [np.bincount(labels, quantity[:, c], count) for c in range(quantity.shape[1])]
        return np.stack(columns, axis=1) / n

    centre = mean(values)
    deviation = np.sqrt(mean((values - centre[labels]) ** 2))
    return Moments(pixels, centre, np.where(deviation < 1e-9, 0.0, deviation))


def compensation(inside: Moments, ring: Moments, settings: ShadowSettings) -> Compensation:
    """Compute the linear map of Eq. 11 for every component, each channel by itself.

    ``deviation`` gives ``mu_ring + (I - mu) * sigma_ring / sigma`` (gain 1 where sigma is 0),
    after which the component has its ring's mean and deviation. ``printed`` gives
    ``mu_ring + (I - mu) / sigma_ring^2 * sigma^2`` (gain 1 where the ring's variance is 0),
    which has the ratio upside down and flattens the region instead.
    """
    if settings.statistic == "deviation":
        numerator, denominator = ring.deviation, inside.deviation
    else:
        numerator, denominator = inside.deviation**2, ring.deviation**2
    gain = np.where(denominator > 0, numerator / np.where(denominator > 0, denominator, 1.0), 1.0)
    if settings.max_gain is not None:
        gain = np.minimum(gain, settings.max_gain)
    applied = (ring.pixels > 0) & (inside.pixels >= settings.min_area)
    applied[0] = False
    here = applied[:, None]
    return Compensation(
        inside.mean,
        np.where(here, ring.mean, inside.mean),
        np.where(here, gain, 1.0),
        applied,
    )


def compensate(
    view: View, found: Components, ring: Packed, settings: ShadowSettings
) -> tuple[Rgb, Compensation]:
    """Apply Eq. 11 to every component of the image that is seen.

    ``ring`` is the union of their buffer rings. Without a component it is the image itself.
    """
    if settings.colour_space == "hsi":
        return _compensate_hsi(view.image, found, ring, settings)
    count, width = found.count + 1, settings.ring_width
    inside = KERNELS.run_sums(view.planes, found.runs, count)
    around = KERNELS.ring_sums(view.planes, found.runs, ring.bits, count, width)
    # In one call: most of its time does not depend on their number.
    both = moments_of_sums(np.concatenate([inside, around]))
    change = compensation(both[:count], both[count:], settings)
    # The kernels take C-contiguous arrays.
    linear = map(np.ascontiguousarray, (change.source, change.target, change.gain))
    image = KERNELS.transfer(view.image, found.runs, *linear) if found.count else view.image
    return image, change


def lift(
    view: View, shadow: Packed, settings: ShadowSettings
) -> tuple[Rgb, Packed, int, Compensation]:
    """Compensate what a mask calls shadow: components, rings, linear map (Eq. 9-11).

    Returns the image, the rings, the number of components, and the map of each.
    """
    found = connected_components(shadow, settings.connectivity)
    ring = buffer_ring(shadow, settings.ring_width)
    image, change = compensate(view, found, ring, settings)
    return image, ring, found.count, change


def _compensate_hsi(
    image: Rgb, found: Components, ring: Packed, settings: ShadowSettings
) -> tuple[Rgb, Compensation]:
    """Compensate saturation and value, keep the hue, and convert back (section 4.2, step 5)."""
    labels = found.labels()
    label, pixel = ring_pairs(labels, ring.pixels(), settings.ring_width)
    flat = image.reshape(-1, 3)
    shadow = np.flatnonzero(labels)
    k = labels.ravel()[shadow]
    values = _saturation_value(flat[shadow])
    inside = moments_of_values(k, values, found.count + 1)
    around = moments_of_values(label, _saturation_value(flat[pixel]), found.count + 1)
    change = compensation(inside, around, settings)
    mapped = change.target[k] + (values - change.source[k]) * change.gain[k]
    mapped = np.clip(mapped, 0.0, 1.0)
    result = flat.copy()
    # Components that are left as they are come back exactly: the conversion inverts every hsi.
    result[shadow] = hsi.to_rgb(hsi.hue(flat[shadow]), mapped[:, 0], mapped[:, 1])
    return result.reshape(image.shape), change


def _saturation_value(rgb: npt.NDArray[np.uint8]) -> Floats:
    return np.stack([hsi.saturation(rgb), hsi.value(rgb)], axis=-1)


def ring_pairs(
    labels: Labels, ring: Mask, width: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return every ``(component, pixel)`` where the pixel lies in the component's ring (Eq. 10).

    Pixels are flat indices; a pixel near two components occurs with both.
    """
    y, x = np.nonzero(ring)
    rows, columns = labels.shape
    size = rows * columns
    pairs = np.empty(0, np.int64)
    for dy in range(-width, width + 1):
        keys = []
        for dx in range(-width, width + 1):
            v, u = y + dy, x + dx
            valid = (v >= 0) & (v < rows) & (u >= 0) & (u < columns)
            near = labels[v[valid], u[valid]].astype(np.int64)
            keys.append((near * size + y[valid] * columns + x[valid])[near > 0])
        # Row by row: the repetitions of a wide ring would take much memory together.
        pairs = np.unique(np.concatenate([pairs, *keys]))
    return pairs // size, pairs % size
