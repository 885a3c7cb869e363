#!/usr/bin/env bash
# `grid-mirror` is "a synonym for reflect" in every filter of SciPy but its newest, where it is `mirror`.
#
# Software: scipy 1.17.1 and 1.16.0, with numpy 2.4.6.
#
# The mode of a filter says how a picture goes on beyond its edge: `reflect` repeats the last pixel
# (d c b a | a b c d), `mirror` does not (d c b | a b c d). For `grid-mirror` the documentation of
# SciPy's filters has "This is a synonym for 'reflect'", and `uniform_filter`, `median_filter`,
# `gaussian_filter`, `correlate` and `generic_filter` obey. `vectorized_filter`, which is new in 1.16 and
# is to be `generic_filter` with speed, takes it for `mirror`. Whoever moves a texture measure or a
# median without NaN from one to the other, function and mode unchanged, gets other values along all
# four edges and nowhere else: on two of three pixels there, by up to 117 grey levels in a picture of
# noise. The lower edge is where a car's camera has the road. All other modes agree in both to the
# last bit. `reflect` means the same in both.
#
# Source: the table `mode_map` in scipy/ndimage/_filters.py has 'grid-mirror': 'reflect', where the words
# on the right are those of `numpy.pad`, in which SciPy's `reflect` is 'symmetric'. The docstring of
# `vectorized_filter` leaves the three grid modes out; its code takes them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.17.1 1.16.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scipy==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import numpy as np
import scipy
from scipy import ndimage

picture = np.random.default_rng(0).integers(0, 256, (120, 160)).astype(float)
inside = np.zeros(picture.shape, bool)
inside[2:-2, 2:-2] = True
generic, fast = {}, {}
for mode in ("reflect", "mirror", "nearest", "constant", "wrap", "grid-constant", "grid-wrap", "grid-mirror"):
    generic[mode] = ndimage.generic_filter(picture, np.median, size=5, mode=mode)
    fast[mode] = ndimage.vectorized_filter(picture, np.median, size=5, mode=mode)
    assert (generic[mode] == fast[mode]).all() == (mode != "grid-mirror"), mode
synonym = "This is a synonym for 'reflect'"
assert synonym in ndimage.generic_filter.__doc__
for call in (ndimage.uniform_filter, ndimage.median_filter):
    assert (call(picture, 5, mode="grid-mirror") == call(picture, 5, mode="reflect")).all()
assert (generic["grid-mirror"] == generic["reflect"]).all()
assert (fast["grid-mirror"] == fast["mirror"]).all()
differs = generic["grid-mirror"] != fast["grid-mirror"]
assert not differs[inside].any()
print(f"SciPy {scipy.__version__}, median of 5x5 with the mode grid-mirror")
print(
    f"  generic_filter: as reflect; vectorized_filter: as mirror; they differ on"
    f" {differs[~inside].mean():.0%} of the pixels at the edge, by up to"
    f" {np.abs(generic['grid-mirror'] - fast['grid-mirror']).max():g} grey levels"
)
PYTHON
done
