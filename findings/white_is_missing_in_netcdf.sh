#!/usr/bin/env bash
# netCDF4 reads the white pixels of a picture as missing, and by whom the file was written decides it.
#
# Software: netCDF4 1.7.5, xarray 2026.9.0 with its engines netcdf4 and h5netcdf (1.8.2); numpy 2.4.6.
#
# A file without any `_FillValue` holds a picture whose sky is white: 255 of uint8, or 65535 of uint16.
# `xarray.open_dataset` returns the numbers as they are. netCDF4 itself returns a masked array in which
# the white pixels are missing, as 255 and 65535 are its default fill values, and NumPy leaves them out
# of the mean: 60 in place of 138. With uint8 it does so only if the file was written by netCDF4, or by
# xarray with its usual engine: the same picture by the engine `h5netcdf` comes back whole. So with
# labels: the void of 255 is left out by the one reader and counted by the other. Of signed numbers it
# is the second least, -127 or -32767, that goes missing. `set_auto_mask(False)` reads all as it is.
#
# Source: documentation of netCDF4's `set_auto_mask`: "converted to a masked array if any of the values
# are exactly equal to the either the netCDF _FillValue or the value specified by the missing_value
# variable attribute"; the file has neither.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  netCDF4==1.7.5.1.post1 h5netcdf==1.8.2 h5py==3.16.0 xarray==2026.9.0 numpy==2.4.6 pandas==3.1.1
cd "$folder"
venv/bin/python - <<'PYTHON'
import warnings

import netCDF4
import numpy as np
import xarray as xr

warnings.simplefilter("error")
print(f"netCDF4 {netCDF4.__version__}, xarray {xr.__version__}, numpy {np.__version__}")


def by_netcdf4(name, picture):
    with netCDF4.Dataset(name, "w") as file:
        file.createDimension("y", picture.shape[0])
        file.createDimension("x", picture.shape[1])
        file.createVariable("picture", picture.dtype, ("y", "x"))[:] = picture


def by_xarray(engine):
    def write(name, picture):
        xr.Dataset({"picture": (("y", "x"), picture)}).to_netcdf(name, engine=engine)

    return write


writers = {
    "netCDF4": by_netcdf4,
    "xarray, netcdf4": by_xarray("netcdf4"),
    "xarray, h5netcdf": by_xarray("h5netcdf"),
}
for kind, dark in (("uint8", 60), ("uint16", 20000)):
    picture = np.full((60, 80), dark, kind)
    picture[:24] = np.iinfo(kind).max
    for writer, write in writers.items():
        write("picture.nc", picture)
        with netCDF4.Dataset("picture.nc") as file:
            assert "_FillValue" not in file["picture"].ncattrs()
            read = file["picture"][:]
            file["picture"].set_auto_mask(False)
            plain = file["picture"][:]
        with xr.open_dataset("picture.nc") as opened:
            of_xarray = opened["picture"].values
        print(f"{kind} by {writer}: mean {read.mean():.0f} by netCDF4", end=", ")
        print(f"{of_xarray.mean():.0f} by xarray, missing {np.ma.getmaskarray(read).mean():.0%}")
        assert np.array_equal(of_xarray, picture) and of_xarray.dtype == picture.dtype
        assert np.array_equal(plain, picture)
        if kind == "uint8" and writer == "xarray, h5netcdf":
            assert np.array_equal(read, picture) and not np.ma.getmaskarray(read).any()
        else:
            assert np.array_equal(np.ma.getmaskarray(read), picture == np.iinfo(kind).max)
            assert read.mean() == dark
PYTHON
