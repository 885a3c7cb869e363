#!/usr/bin/env bash
# HDF5 stores a score of 0.09 to one digit as 0.0, not 0.1, and shows it only once the file was closed.
#
# Software: h5py 3.16.0 (with HDF5 in its wheel), with numpy 2.4.6.
#
# `create_dataset(..., scaleoffset=1)` keeps one digit behind the point: an error of at most 0.05 is
# what one expects, and what one gets, save near the fill value, which is 0 unless stated. What lies
# within a whole unit of it, 0.1 here, is stored as the fill value itself: 0.06 to 0.099 become 0.0 and
# not 0.1. Of scores from 0.051 to 0.099, none is above 0.05 any more; with `scaleoffset=0`, as for
# scores in per cent or depths in metres, 0.99 becomes 0. And a test that reads what it wrote sees none
# of it: until the file is closed, even after `flush`, h5py returns the exact numbers from its cache of
# chunks. A `fillvalue` far from all numbers, here -1000, mends it.
#
# Source: documentation of `create_dataset`: "For floating point data, scaleoffset is the number of
# digits after the decimal place to retain; stored values thus have absolute error less than
# 0.5*10**(-scaleoffset)". It does not speak of the fill value.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check h5py==3.16.0 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
import h5py
import numpy as np

print(f"h5py {h5py.__version__}, HDF5 {h5py.version.hdf5_version}, numpy {np.__version__}")


def stored(numbers, digits, **options):
    """Write numbers; return them as read before and after the file was closed."""
    with h5py.File("scores.h5", "w") as file:
        dataset = file.create_dataset("scores", data=numbers, scaleoffset=digits, **options)
        file.flush()
        before = dataset[:]
    with h5py.File("scores.h5") as file:
        return before, file["scores"][:]


for kind in ("float32", "float64"):
    for digits in (0, 1, 2):
        unit = 10.0**-digits
        scores = (np.arange(2001) * unit / 100).astype(kind)  # 0 to 20 units
        before, after = stored(scores, digits)
        assert np.array_equal(before, scores)
        error = np.abs(after.astype(float) - scores) / unit
        faint = (scores > 0.005 * unit) & (scores < 0.985 * unit)
        print(f"{kind}, {digits} digits: error up to {error.max():.2f} units", end=", ")
        print(f"{error[scores > 1.015 * unit].max():.2f} above one unit;", end=" ")
        print(f"0.9 units become {after[90] / unit:.1f}, before closing {before[90] / unit:.1f}")
        assert np.all(after[faint] == 0) and error.max() > 0.97
        assert error[scores > 1.015 * unit].max() < 0.51

        _, mended = stored(scores, digits, fillvalue=-1000.0)
        assert (np.abs(mended.astype(float) - scores) / unit).max() < 0.51

faint = np.linspace(0.051, 0.099, 49)
_, after = stored(faint, 1)
_, mended = stored(faint, 1, fillvalue=-1000.0)
print(f"scores of 0.051 to 0.099 above 0.05: {(after > 0.05).sum()}", end=", ")
print(f"with a far fill value {(mended > 0.05).sum()}")
assert not (after > 0.05).any() and (mended > 0.05).all()
PYTHON
