#!/usr/bin/env bash
# xarray appends a drive to a Zarr file with times 1000 times too far: 10 s later is 2 h 46 min later.
#
# Software: xarray 2026.9.0 with zarr 3.1.6, in formats 2 and 3 of Zarr; with numpy 2.4.6.
#
# A first drive has a value each second, on the full second, and is written by `to_zarr`. A second one,
# which begins 10 s later at 10 Hz, is added by `to_zarr(..., append_dim="time")`. xarray stores times
# as whole numbers in the coarsest unit that fits, here "seconds since" the first, as the first drive
# needs no more. The second needs tenths, so its numbers are written in milliseconds; but the unit in
# the file stays "seconds", and all readers believe it. A warning says "Serializing with units
# 'milliseconds since ...' instead", which sounds as if all were well. With stamps of a camera in
# nanoseconds the first unit may be milliseconds and the second nanoseconds: 10 s become 115 days. What
# is asked for by time, as the value at 15 s, is not found or is that of another time, and the rate of
# pictures drops. A unit that is given with the first drive, `encoding={"time": {"units": "nanoseconds
# since 1970-01-01"}}`, is kept to, and nothing is moved.
#
# Source: documentation of `Dataset.to_zarr`: "append_dim: If set, the dimension along which the data
# will be appended"; issues 5969 (closed) and 10639 of pydata/xarray tell of days and hours.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  xarray==2026.9.0 zarr==3.1.6 numpy==2.4.6 pandas==3.1.1
cd "$folder"
venv/bin/python - <<'PYTHON'
import warnings

import numpy as np
import xarray as xr
import zarr

print(f"xarray {xr.__version__}, zarr {zarr.__version__}, numpy {np.__version__}")
start = np.datetime64("2026-03-02T09:00:00", "ns")


def drive(begin_ns, step_ns):
    """Ten values of a drive with the time of each."""
    time = start + (begin_ns + step_ns * np.arange(10)).astype("timedelta64[ns]")
    return xr.Dataset({"share": ("time", np.linspace(0.2, 0.4, 10))}, coords={"time": time})


def seconds_read(name, drives, zarr_format, **options):
    """Write drives one behind the other; return the times that are read, in s, and the warnings."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        drives[0].to_zarr(name, zarr_format=zarr_format, consolidated=False, **options)
        for one in drives[1:]:
            one.to_zarr(name, append_dim="time", consolidated=False)
    read = xr.open_zarr(name, consolidated=False)["time"].values
    seconds = (read - start) / np.timedelta64(1, "s")
    return seconds, [str(warning.message) for warning in told if "Times" in str(warning.message)]


second = 10**9
for zarr_format in (2, 3):
    name = f"drives{zarr_format}"
    drives = [drive(0, second), drive(10 * second, second // 10)]
    seconds, told = seconds_read(name, drives, zarr_format)
    units = zarr.open_group(name, mode="r")["time"].attrs["units"]
    print(f"Zarr {zarr_format}: {units}; read {seconds[8:13]}")
    assert units.startswith("seconds since")
    assert np.allclose(seconds[:10], np.arange(10))
    assert np.allclose(seconds[10:], 1000 * (10 + 0.1 * np.arange(10)))
    assert len(told) == 1 and "Serializing with units 'milliseconds since" in told[0]

    drives = [drive(0, second // 10), drive(10 * second, 33_333_333)]
    seconds, _ = seconds_read(name + "ns", drives, zarr_format)
    print(f"  first unit milliseconds: read {seconds[9]} s, then {seconds[10] / 86400:.1f} days")
    assert np.isclose(seconds[10], 1e6 * 10)

    units = {"time": {"units": "nanoseconds since 1970-01-01"}}
    seconds, told = seconds_read(name + "unit", drives, zarr_format, encoding=units)
    print(f"  with a unit of one's own: read {seconds[9:12]}")
    assert np.allclose(seconds[10:], 10 + 0.033333333 * np.arange(10), atol=1e-9)
    assert not told
PYTHON
