#!/usr/bin/env bash
# xarray reads class 0 of a label image in Zarr 2 as missing, and a mask of False and True as all road.
#
# Software: xarray 2026.9.0 with zarr 3.1.6; with numpy 2.4.6.
#
# An array of Zarr has a fill value, which stands for chunks that were never written. zarr itself sets
# it to 0 or False. xarray takes the fill value of a file of Zarr 2 for a mark of missing values: what
# equals it becomes NaN, although zarr wrote it and reads it back as 0. A label image of ground (0),
# road (1) and sky (2) in uint8 comes back as float32 with NaN for the ground, and its mean is that of
# the other pixels alone. A mask of type bool comes back as objects, True and NaN: of an image that is
# two thirds road, `mask.mean()` says 1.0, the mean of an all-empty mask is NaN, and so is its agreement
# with itself less than one, as NaN equals nothing: `(mask == mask).mean()` is 0.67. The same array in
# Zarr 3 comes back as it was, and so does one that xarray wrote in Zarr 2, so tests with files of one's
# own do not show it. The documented way out, `use_zarr_fill_value_as_mask=False`, changes nothing in
# `open_zarr` or `open_dataset` of this version, which do not pass it on; `mask_and_scale=False` reads
# the values as they are.
#
# Source: documentation of `open_zarr`: "use_zarr_fill_value_as_mask: If True, use the zarr Array
# fill_value to mask the data ... If False, the fill_value is ignored and the data are not masked. If
# None, this defaults to True for zarr_format=2 and False for zarr_format=3"; zarr's of `create_array`
# says of `fill_value` only "Fill value for the array".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  xarray==2026.9.0 zarr==3.1.6 numpy==2.4.6 pandas==3.1.1
cd "$folder"
venv/bin/python - <<'PYTHON'
import numpy as np
import xarray as xr
import zarr

print(f"xarray {xr.__version__}, zarr {zarr.__version__}, numpy {np.__version__}")
labels = np.zeros((60, 80), np.uint8)
labels[:10], labels[30:] = 2, 1
road = np.zeros((60, 80), bool)
road[20:] = True


def written(name, array, zarr_format):
    """Write an array with zarr itself, with the names of its dimensions, as xarray needs them."""
    group = zarr.open_group(name, mode="w", zarr_format=zarr_format)
    if zarr_format == 2:
        group.create_array("picture", data=array).attrs["_ARRAY_DIMENSIONS"] = ["y", "x"]
    else:
        group.create_array("picture", data=array, dimension_names=["y", "x"])
    assert np.array_equal(zarr.open_group(name, mode="r")["picture"][:], array)
    return name


def read(name, **options):
    return xr.open_zarr(name, consolidated=False, **options)["picture"].load()


for zarr_format in (2, 3):
    of_labels = read(written(f"labels{zarr_format}", labels, zarr_format))
    of_road = read(written(f"road{zarr_format}", road, zarr_format))
    print(f"Zarr {zarr_format}: labels are {of_labels.dtype}: {np.unique(of_labels.values)};", end=" ")
    print(f"road is {of_road.dtype}, mean {float(of_road.mean()):.2f},", end=" ")
    print(f"equal to itself {float((of_road == of_road).mean()):.2f}")
    if zarr_format == 2:
        assert np.array_equal(np.isnan(of_labels.values), labels == 0)
        assert of_road.dtype == object and float(of_road.mean()) == 1.0
        assert abs(float((of_road == of_road).mean()) - road.mean()) < 1e-9
    else:
        assert np.array_equal(of_labels, labels) and of_labels.dtype == np.uint8
        assert np.array_equal(of_road, road) and of_road.dtype == bool

assert float(read("road2", use_zarr_fill_value_as_mask=False).mean()) == 1.0
empty = read(written("empty", np.zeros_like(road), 2))
assert np.isnan(float(empty.mean()))
plain = read("road2", mask_and_scale=False)
assert np.array_equal(plain, road) and plain.dtype == bool
xr.Dataset({"picture": (("y", "x"), road)}).to_zarr("own", zarr_format=2, consolidated=False)
assert np.array_equal(read("own"), road)
print(f"Zarr 2 with mask_and_scale=False, or written by xarray: mean {float(plain.mean()):.2f}")
PYTHON
