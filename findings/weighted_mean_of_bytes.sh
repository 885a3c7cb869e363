#!/usr/bin/env bash
# xarray's mean of a flat depth map of 2000 mm within a mask is 15 mm, as its sums keep to 16 bits.
#
# Software: xarray 2026.9.0, against numpy 2.4.6.
#
# `picture.weighted(weights).mean()` is the weighted mean, and with a mask of type bool as weights the
# mean within the mask. `picture.mean()` of the same integers is right, as is NumPy's `average` with the
# same weights: both add up in more bits. The weighted mean divides the sum of products by the sum of
# weights, and keeps the former in the type of the picture, if the weights are bool or as narrow: modulo
# 256 for uint8, modulo 65536 for uint16. The depth map is uint16 here, as from ROS (16UC1) or a 16-bit
# PNG. A road mask of 0 and 1 (uint8) has a share of 0.02 in place of 0.49 within the pixels that are
# valid (bool), and of 1.13 by a map of confidence of uint8, whose sum wraps as well. `sum`, `var` and
# `std` of `weighted` are wrong alike. No warning is given. Weights of floats, or
# `weights.astype(float)`, give the right number.
#
# Source: documentation of `DataArrayWeighted.mean`: "Reduce this Dataset's data by a weighted mean
# along some dimension(s)"; of its `sum_of_weights` it is only said that bool is counted as int.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  xarray==2026.9.0 numpy==2.4.6 pandas==3.1.1
"$folder/venv/bin/python" - <<'PYTHON'
import warnings

import numpy as np
import xarray as xr

warnings.simplefilter("error")
print(f"xarray {xr.__version__}, numpy {np.__version__}")
confidence = np.random.default_rng(0).integers(100, 256, (60, 80)).astype(np.uint8)
valid = confidence > 150
depth = np.full((60, 80), 2000, np.uint16)
road = np.zeros((60, 80), np.uint8)
road[30:] = 1


def mean(picture, weights):
    """The weighted mean by xarray."""
    return float(xr.DataArray(picture).weighted(xr.DataArray(weights)).mean())


for name, picture, weights, wrong in (
    ("depth within a mask", depth, valid, 15.3),
    ("road within a mask", road, valid, 0.0185),
    ("road by confidence", road, confidence, 1.128),
):
    told = mean(picture, weights)
    right = np.average(picture, weights=weights)
    assert np.isclose(right, (picture.astype(float) * weights).sum() / weights.sum(dtype=float))
    print(f"{name}: {told:.4g} by xarray, {right:.4g} by NumPy", end=", ")
    print(f"{mean(picture, weights.astype(float)):.4g} by xarray with weights of float")
    assert np.isclose(told, wrong, rtol=0.01)
    assert np.isclose(mean(picture, weights.astype(float)), right)

bits = 2 ** (8 * depth.itemsize)
assert np.isclose(mean(depth, valid), int(valid.sum()) * 2000 % bits / valid.sum(), rtol=1e-4)
assert np.isclose(mean(road, valid), int(road[valid].sum()) % 256 / valid.sum(), rtol=1e-4)
assert float(xr.DataArray(depth).mean()) == 2000
PYTHON
