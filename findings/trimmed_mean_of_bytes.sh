#!/usr/bin/env bash
# SciPy's `tmean` of a mask that is 61% road is 1.0, and of a picture whose mean is 128.6 it is 0.3.
#
# Software: scipy 1.17.1 with numpy 2.4.6, against 1.13.1 with numpy 1.26.4.
#
# `scipy.stats.tmean` is a mean of the values within limits, or of all if no limits are given. Up to
# SciPy 1.13 it was NumPy's mean then. Now it adds up in the type of its input, and counts the values
# in that type, too. Of bool the sum is True and the number is True, so that any mask with a pixel of
# road has a mean of 1.0. Of uint8 both are kept modulo 256: a picture of 4,001 pixels has 161 of them.
# The result is a float. Nothing is raised or warned of. Limits that leave no value out change nothing.
# As soon as they leave one out, it is computed with floats and is right. `tstd` and `tvar` are right.
#
# `astype(float)` mends it, and so does `numpy.mean`.
#
# Source: `tmean` in scipy/stats/_stats_py.py has `dtype=a.dtype` in both of its sums. Its documentation
# asks for "array_like", and has whole numbers without limits as its first example.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.17.1 1.13.1; do
  [ $version = 1.17.1 ] && numpy=2.4.6 || numpy=1.26.4
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scipy==$version numpy==$numpy
  "$folder/$version/bin/python" -W error - <<'PYTHON'
import numpy as np
import scipy
from scipy import stats

is_new = scipy.__version__ == "1.17.1"
picture = np.random.default_rng(0).integers(0, 256, 4001)
arrays = {
    "mask as bool": picture > 101,
    "picture as uint8": picture.astype(np.uint8),
    "picture as uint16": picture.astype(np.uint16),
    "picture as int64": picture,
}
print(f"SciPy {scipy.__version__}: tmean of all, tmean from 10 to 250, and both by NumPy")
for name, array in arrays.items():
    all_values, right = stats.tmean(array), array.mean()
    line = f"  {name}: {all_values:.4f} (NumPy: {right:.4f})"
    wraps = array.dtype != np.int64
    assert np.isclose(all_values, right) == (not is_new or not wraps)
    if array.dtype == np.bool_:
        assert not is_new or all_values == 1
    else:
        within, limited = stats.tmean(array, (10, 250)), array[(array >= 10) & (array <= 250)].mean()
        line += f"; {within:.4f} (NumPy: {limited:.4f})"
        assert np.isclose(within, limited)
        assert stats.tmean(array, (0, 255)) == all_values
        assert np.isclose(stats.tstd(array), array.std(ddof=1))
        assert np.isclose(stats.tvar(array), array.var(ddof=1))
    print(line)
PYTHON
done
