"""The paper's pipeline the plain way, to be held beside the paper: an equation, a few lines.

NumPy, scikit-image and scikit-learn alone, nothing of roadeval, and no thought of speed.
``printed`` selects the misprints taken literally. Images are ``(H, W, 3)`` uint8 RGB, masks
``(H, W)`` bool.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from skimage.filters import threshold_otsu
from skimage.measure import label, regionprops
from skimage.morphology import dilation, erosion
from sklearn.covariance import EmpiricalCovariance
from sklearn.metrics import pairwise_distances
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

CHI2_95 = 7.814727903251179
"""0.95 quantile of the chi-squared distribution with 3 degrees of freedom."""


# --- Colour: Eq. 3-5 ------------------------------------------------------------------------------


def value(rgb):
    return rgb.sum(axis=-1) / 3 / 255  # Eq. 3


def saturation(rgb):
    total = rgb.sum(axis=-1)
    return np.where(total == 0, 0.0, 1 - 3 / np.maximum(total, 1) * rgb.min(axis=-1))  # Eq. 4


def hue(rgb):
    """Eq. 5 in degrees: the angle of the colour about the grey axis, from red."""
    r, g, b = np.moveaxis(rgb.astype(float), -1, 0)
    return np.degrees(np.arctan2(np.sqrt(3) * (g - b), 2 * r - g - b)) % 360


def from_hsi(h, s, v):
    rgb = np.empty((*h.shape, 3))
    for sector, (leading, following, least) in enumerate([(0, 1, 2), (1, 2, 0), (2, 0, 1)]):
        here = h // 120 == sector
        angle = np.radians(h[here] - 120 * sector)
        rgb[here, least] = v[here] * (1 - s[here])
        rgb[here, leading] = v[here] * (1 + s[here] * np.cos(angle) / np.cos(np.pi / 3 - angle))
        rgb[here, following] = 3 * v[here] - rgb[here, least] - rgb[here, leading]
    return 255 * rgb


# --- Shadow: Eq. 6-11 -----------------------------------------------------------------------------


def ndi_codes(rgb):
    s, v = saturation(rgb), value(rgb)
    ndi = np.where(s + v == 0, -1.0, (s - v) / np.where(s + v == 0, 1.0, s + v))  # Eq. 6
    # Noise in the last digits must not decide how a half is rounded.
    return np.rint(np.round((ndi + 1) * 127.5, 9)).astype(np.uint8)


def shadow_mask(codes, printed=False):
    """Eq. 7 and 8."""
    if codes.min() == codes.max():
        return np.zeros(codes.shape, bool)
    return codes >= threshold(codes, printed) if printed else codes > threshold_otsu(codes)


def threshold(codes, printed=False):
    """Eq. 7 in fractions, so that equals are equal: its first maximum, or None of one level."""
    levels, counts = np.unique(codes, return_counts=True)
    p = {int(j): Fraction(int(n), codes.size) for j, n in zip(levels, counts, strict=True)}
    mean = sum(j * p[j] for j in p)
    criterion = {}
    for t in range(256):
        w = sum(p[j] for j in p if j <= t)
        mu = 1 - w if printed else sum(j * p[j] for j in p if j <= t)
        if 0 < w < 1:
            criterion[t] = (mean * w - mu) ** 2 / (w * (1 - w))
    return max(criterion, key=criterion.get, default=None)


def components(mask, width=1, connectivity=2):
    """Eq. 9 and 10: each component's neighbourhood, itself and its buffer ring in it."""
    labels = label(mask, connectivity=connectivity)
    for region in regionprops(labels):
        top, left, bottom, right = region.bbox
        box = np.s_[max(top - width, 0) : bottom + width, max(left - width, 0) : right + width]
        inside = labels[box] == region.label
        yield box, inside, dilate(inside, 2 * width + 1) & ~mask[box]


def rings(mask, width=1):
    """The union of all buffer rings."""
    union = np.zeros(mask.shape, bool)
    for box, _, ring in components(mask, width):
        union[box] |= ring
    return union


def transfer(values, mask, width=1, printed=False, *, connectivity=2, most=None):
    """Eq. 11 on the channels of an ``(H, W, C)`` array."""
    values = values.astype(float)
    result = values.copy()
    for box, place, ring in components(mask, width, connectivity):
        if ring.any():
            inside, around = values[box][place], values[box][ring]
            sigma, sigma_ring = _std(inside), _std(around)
            gain = _ratio(sigma**2, sigma_ring**2) if printed else _ratio(sigma_ring, sigma)
            gain = gain if most is None else np.minimum(gain, most)
            result[box][place] = around.mean(axis=0) + (inside - inside.mean(axis=0)) * gain
    return result


def _std(values):
    deviation = values.std(axis=0)
    return np.where(deviation < 1e-9, 0.0, deviation)


def _ratio(a, b):
    return np.where(b == 0, 1.0, a / np.where(b == 0, 1.0, b))


def compensate(rgb, mask, printed=False):
    """Eq. 11 in RGB, or as printed in saturation and value: float, neither rounded nor clipped."""
    if not printed:
        return transfer(rgb, mask)
    s, v = np.moveaxis(transfer(np.stack([saturation(rgb), value(rgb)], -1), mask, 1, True), -1, 0)
    compensated = from_hsi(hue(rgb), np.clip(s, 0, 1), np.clip(v, 0, 1))
    return np.where(mask[..., None], compensated, rgb)


# --- Classification: Eq. 2 and 12-16 --------------------------------------------------------------


@dataclass(frozen=True)
class Model:
    road: EmpiricalCovariance
    machine: Pipeline


def train(colours, road, kernel="rbf"):
    """From ``(n, 3)`` colours and their ``(n,)`` bool labels."""
    machine = make_pipeline(StandardScaler(), SVC(C=1.0, kernel=kernel, gamma=0.5))
    return Model(EmpiricalCovariance().fit(colours[road]), machine.fit(colours, road))


def distance(rgb, model, ridge=1.0):
    """Eq. 2."""
    precision = np.linalg.inv(model.road.covariance_ + ridge * np.eye(3))
    flat, mean = rgb.reshape(-1, 3).astype(float), model.road.location_[None]
    return pairwise_distances(flat, mean, "mahalanobis", VI=precision).reshape(rgb.shape[:2])


def decision(rgb, model):
    """Eq. 16 before its sign, of each colour once: it takes seconds for every pixel of an image."""
    _, first, place = np.unique(rgb @ (1 << 16, 1 << 8, 1), return_index=True, return_inverse=True)
    return model.machine.decision_function(rgb.reshape(-1, 3)[first])[place].reshape(rgb.shape[:2])


# --- Post-processing: Eq. 17-23 -------------------------------------------------------------------


def post(mask, printed=False):
    """Open and close (as printed: close and open), keep the largest component, fill its holes."""
    side = max(3, 2 * (mask.shape[1] // 200) + 1)
    smoothed = opened(closed(mask, side), side) if printed else closed(opened(mask, side), side)
    return filled(largest(smoothed))


def boundary(mask):
    return mask & ~_on_a_plane(erode, mask, 3)  # Eq. 22


def dilate(mask, side):
    return dilation(mask, np.ones((side, side)), mode="constant", cval=0)  # Eq. 17


def erode(mask, side):
    return erosion(mask, np.ones((side, side)), mode="constant", cval=0)  # Eq. 18


def opened(mask, side):
    return _on_a_plane(lambda m, b: dilate(erode(m, b), b), mask, side)  # Eq. 20


def closed(mask, side):
    return _on_a_plane(lambda m, b: erode(dilate(m, b), b), mask, side)  # Eq. 21


def _on_a_plane(operation, mask, side):
    """Apply an operation with so much non-road around that the plane's edge plays no part."""
    return operation(np.pad(mask, 2 * side), side)[2 * side : -2 * side, 2 * side : -2 * side]


def largest(mask):
    labels = label(mask, connectivity=2)
    sizes = np.bincount(labels.ravel())
    return labels == 1 + np.argmax(sizes[1:]) if mask.any() else mask


def filled(mask):
    """Eq. 23's fixed point: all that is not joined to the outside."""
    outside = label(np.pad(~mask, 1, constant_values=True), connectivity=1)
    return (outside != outside[0, 0])[1:-1, 1:-1]


# --- The chain ------------------------------------------------------------------------------------


def layers(rgb, model, *, filtered=True, printed=False):
    """Every layer by name, on one image."""
    result = {}
    if filtered:
        codes = ndi_codes(rgb)
        shadow = shadow_mask(codes, printed)
        result |= {"ndi": codes, "shadow": shadow, "rings": shadow + 2 * rings(shadow)}
        rgb = np.clip(np.rint(compensate(rgb, shadow, printed)), 0, 255).astype(np.uint8)
        result["compensated"] = rgb
    result["distance"] = distance(rgb, model)
    result["similarity"] = result["distance"] ** 2 <= CHI2_95
    result["svm"] = decision(rgb, model) > 0
    result["post"] = post(result["svm"], printed)
    result["boundary"] = boundary(result["post"])
    return result
