#!/usr/bin/env bash
# SciPy's cosine distance of two different masks of True and False is 0: "they are the same".
#
# Software: scipy 1.17.1, against 1.11.4; numpy 2.4.6 and 1.26.4.
#
# `scipy.spatial.distance.cosine(u, v)` and `cdist(..., "cosine")` are documented as one distance. A
# stuck camera, a frame that was stored twice or a mask that follows nothing is looked for by a
# distance of 0 between the masks of two frames. Since SciPy 1.12 `cosine` computes with the type that
# it is given, and the product of two arrays of bool is True or False. So two masks that share one
# pixel have a distance of 0, and two without a shared pixel 1: nothing lies between. Nothing is
# raised or warned of. `cdist`, `pdist` and SciPy 1.11 compute with floats: 0.4655 and 0.9310 for the
# same masks. `correlation`, whose code `cosine` runs, is right for bool, as it subtracts a mean first.
#
# With masks of uint8 the sums are kept modulo 256, and the same two pairs have 0.0 and 0.29; there
# NumPy may warn of an overflow. `astype(float)` mends both.
#
# Source: the values of each. The documentation of `cosine` asks for "array_like of floats"; SciPy's
# other distances of two vectors convert bool, or raise.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.17.1 1.11.4; do
  [ $version = 1.17.1 ] && numpy=2.4.6 || numpy=1.26.4
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scipy==$version numpy==$numpy
  "$folder/$version/bin/python" - <<'PYTHON'
import warnings

import numpy as np
import scipy
from scipy.spatial.distance import cdist, correlation, cosine

is_new = scipy.__version__ == "1.17.1"
road, other, speck, apart = np.zeros((4, 48, 64), bool)
road[20:, 10:50] = True
other[24:, 30:60] = True
speck[44:, 9:12] = True
apart[:10] = True
print(f"SciPy {scipy.__version__}, NumPy {np.__version__}")
for name, mask in (("half shared", other), ("a speck shared", speck), ("apart", apart), ("same", road)):
    shared = (road & mask).sum() / np.sqrt(road.sum() * mask.sum())
    u, v = road.ravel(), mask.ravel()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        by_bool = cosine(u, v)
        by_float = cosine(u.astype(float), v.astype(float))
    by_cdist = cdist([u], [v], "cosine")[0, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        by_byte = cosine(u.astype(np.uint8), v.astype(np.uint8))
    print(
        f"  {name}: cosine of bool {by_bool:.4f}, of uint8 {by_byte:.4f}, of float {by_float:.4f},"
        f" cdist of bool {by_cdist:.4f}"
    )
    assert np.isclose(by_float, 1 - shared) and np.isclose(by_cdist, 1 - shared)
    assert np.isclose(correlation(u, v), correlation(u.astype(float), v.astype(float)))
    if is_new:
        assert by_bool == (0 if shared else 1)
        assert mask is apart or mask is road or not np.isclose(by_byte, 1 - shared, atol=0.1)
    else:
        assert np.isclose(by_bool, 1 - shared) and np.isclose(by_byte, 1 - shared)
PYTHON
done
