#!/usr/bin/env bash
# A picture half-way between two labels gets the earlier one by pandas and the later one by Polars.
#
# Software: pandas 3.1.1, Polars 2.1.0 and xarray 2026.9.0.
#
# Labels come at 10 Hz and pictures at 20 Hz from one clock, so that every second picture lies exactly
# between two labels. "The nearest" is then either. `pandas.merge_asof(direction="nearest")` takes the
# label before it, Polars' `join_asof(strategy="nearest")` the one after it, and so do pandas' own
# `reindex(method="nearest")` and xarray's `sel(method="nearest")`. Half of all pictures get another
# label when a script moves from one to the other, which looks like a shift of the whole drive by half
# a label's period. It happens with integers, with floats and with times. The documentation of
# `merge_asof` has no rule for it. That of `get_indexer`, in the same library, prefers the larger
# value, and Polars says that its join takes the last row of those that are nearest. Times that jitter
# do not show it, and a log of a simulation or of triggered cameras does.
#
# Source: the numbers of the labels; the documentation of pandas.Index.get_indexer, pandas.merge_asof
# and polars.DataFrame.join_asof.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  pandas==3.1.1 polars==2.1.0 pyarrow==26.0.1 xarray==2026.9.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import pandas as pd
import polars as pl
import xarray as xr

COUNT = 40
PERIOD = 50_000_000  # ns, of the camera
times = np.arange(COUNT) * PERIOD
label_times = np.arange(0, COUNT + 2, 2) * PERIOD
numbers = np.arange(len(label_times))
EARLIER = np.arange(COUNT) // 2
LATER = (np.arange(COUNT) + 1) // 2


def by_merge_asof(pictures, labels):
    return pd.merge_asof(pictures, labels, on="time", direction="nearest")["label"]


def by_polars(pictures, labels):
    left, right = pl.from_pandas(pictures), pl.from_pandas(labels)
    return left.join_asof(right, on="time", strategy="nearest")["label"]


def by_reindex(pictures, labels):
    return labels.set_index("time").reindex(pictures["time"], method="nearest")["label"]


def by_xarray(pictures, labels):
    rows = xr.DataArray(labels["label"], dims="time", coords={"time": labels["time"].to_numpy()})
    return rows.sel(time=pictures["time"].to_numpy(), method="nearest")


print("pandas", pd.__version__, "Polars", pl.__version__, "xarray", xr.__version__)
EXPECTED = {by_merge_asof: EARLIER, by_polars: LATER, by_reindex: LATER, by_xarray: LATER}
for kind in ("int64", "float64", "datetime64[ns]"):
    pictures = pd.DataFrame({"time": times.astype(kind)})
    labels = pd.DataFrame({"time": label_times.astype(kind), "label": numbers})
    for join, expected in EXPECTED.items():
        found = np.asarray(join(pictures, labels))
        print(f"{kind}, {join.__name__}: {found[:8]} ...")
        assert np.array_equal(found, expected)
print(f"{(EARLIER != LATER).sum()} of {COUNT} pictures get another label")
PYTHON
