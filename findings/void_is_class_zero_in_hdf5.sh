#!/usr/bin/env bash
# h5py writes the void label -1 as class 0 into an array of uint8, and as 255 if it writes pixel by pixel.
#
# Software: h5py 3.16.0, against zarr 3.1.6; with numpy 2.4.6.
#
# Labels of int16 or int64 with -1 for void, as many training programs use it, go into an HDF5 file of
# uint8. NumPy's `astype` and zarr make 255 of -1, which is what most tools take for void in 8 bits.
# HDF5 clips: by `dataset[:] = labels`, by `create_dataset(data=labels, dtype="uint8")` and by
# `write_direct`, -1 becomes 0, the first class, and 300 becomes 255, which is void. But h5py hands a
# NumPy scalar or a list of them to NumPy first, so that `dataset[row, column] = label` and
# `dataset[row] = list` make 255 of -1 and 44 of 300. Reading is as divided:
# `dataset.astype("uint8")[:]` clips, and `dataset[:].astype("uint8")` wraps. A frame with a fifth of
# void, the rest ground (0) and road (1), has no void left after it was written as a whole: a prediction
# that says road there, and is right elsewhere, has an IoU of 0.67 in place of 1. No warning is given.
#
# Source: documentation of `Dataset.astype`: "Get a wrapper allowing you to perform reads to a different
# destination type"; of `create_dataset`: dtype "overrides data array's dtype". Neither says that HDF5
# clips.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  h5py==3.16.0 zarr==3.1.6 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
import warnings

import h5py
import numpy as np
import zarr

warnings.simplefilter("error")
print(f"h5py {h5py.__version__}, zarr {zarr.__version__}, numpy {np.__version__}")
labels = np.zeros((50, 80), np.int16)
labels[30:], labels[:10] = 1, -1
predicted = (labels != 0).astype(np.uint8)  # right, and road in the void, where nothing counts


def iou(truth):
    """IoU of road over the pixels that are not void (255)."""
    counted = truth != 255
    both = (truth == 1) & (predicted == 1) & counted
    either = ((truth == 1) | (predicted == 1)) & counted
    return both.sum() / either.sum()


with h5py.File("labels.h5", "w") as file:
    whole = file.create_dataset("whole", labels.shape, "uint8")
    whole[:] = labels
    created = file.create_dataset("created", data=labels, dtype="uint8")
    by_pixel = file.create_dataset("by pixel", labels.shape, "uint8")
    by_list = file.create_dataset("by list", labels.shape, "uint8")
    for row in range(len(labels)):
        by_list[row] = list(labels[row])
        for column in range(labels.shape[1]):
            by_pixel[row, column] = labels[row, column]
    as_it_is = file.create_dataset("int16", data=labels)
    in_zarr = zarr.create_array("labels.zarr", shape=labels.shape, dtype="uint8")
    in_zarr[:] = labels
    ways = {
        "h5py, whole": (whole[:], 0),
        "h5py, created with data": (created[:], 0),
        "h5py, read by astype": (as_it_is.astype("uint8")[:], 0),
        "h5py, pixel by pixel": (by_pixel[:], 255),
        "h5py, rows as lists": (by_list[:], 255),
        "h5py, astype when read": (as_it_is[:].astype("uint8"), 255),
        "zarr, whole": (in_zarr[:], 255),
    }
    for way, (truth, void) in ways.items():
        print(f"{way}: -1 is {truth[0, 0]}, IoU of road {iou(truth):.2f}")
        assert truth.dtype == np.uint8 and np.all(truth[:10] == void)
        assert np.array_equal(truth[10:], labels[10:])
        assert np.isclose(iou(truth), 1 if void == 255 else 2 / 3)

    great = file.create_dataset("great", (2,), "uint8")
    great[:] = np.array([300, 300])
    great[1] = np.int64(300)
    print(f"300 written whole is {great[0]}, alone {great[1]}")
    assert great[:].tolist() == [255, 44]
PYTHON
