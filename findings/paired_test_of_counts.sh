#!/usr/bin/env bash
# SciPy's paired t-test of two methods' error counts has p = 3e-32, as the counts have no sign.
#
# Software: scipy 1.17.1 and 1.11.4, with numpy 2.4.6 and 1.26.4.
#
# Two methods are compared by the wrong pixels that each has in the same 200 frames. On average neither
# is better. Counts are never negative, so a table keeps them as uint16 or uint32. `ttest_rel`
# subtracts them in that type: a frame in which the second has five more differs by 65,531. The test
# then has a difference of 28,518 to 37,674 wrong pixels, where no frame has a thousand, and p is
# 3e-32. By `alternative="greater"` the first has more with certainty, and so has the second, if the
# arguments are exchanged. Nothing is raised or warned of. With the same counts as int64, p is 0.78.
#
# `ttest_ind`, `ttest_1samp` and, since it was mended, `wilcoxon` are right for the same arrays; in SciPy
# 1.11 `wilcoxon` is wrong as well.
#
# Source: `ttest_rel` in scipy/stats/_stats_py.py hands `a - b` to the test of one sample. The
# documentation asks for "array_like", and for no type.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.17.1 1.11.4; do
  [ $version = 1.17.1 ] && numpy=2.4.6 || numpy=1.26.4
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scipy==$version numpy==$numpy
  "$folder/$version/bin/python" -W error - <<'PYTHON'
import numpy as np
import scipy
from scipy import stats

rng = np.random.default_rng(0)
hard = rng.integers(100, 900, 200)  # How hard each frame is, for both.
first, second = hard + rng.integers(0, 60, (2, 200))
is_new = scipy.__version__ == "1.17.1"
print(f"SciPy {scipy.__version__}: mean counts {first.mean():.1f} and {second.mean():.1f}")
for dtype in (np.int64, np.uint16, np.uint32):
    a, b = first.astype(dtype), second.astype(dtype)
    assert (a == first).all() and (b == second).all()
    test = stats.ttest_rel(a, b)
    low, high = test.confidence_interval()
    one_sided = [stats.ttest_rel(*pair, alternative="greater").pvalue for pair in ((a, b), (b, a))]
    others = {
        "wilcoxon": stats.wilcoxon(a, b).pvalue,
        "ttest_ind": stats.ttest_ind(a, b).pvalue,
        "ttest_1samp": stats.ttest_1samp(a, 500).pvalue,
    }
    print(
        f"  {dtype.__name__}: ttest_rel p = {test.pvalue:.2g}, difference {low:.0f} to {high:.0f};"
        f" A greater p = {one_sided[0]:.2g}, B greater p = {one_sided[1]:.2g};"
        f" wilcoxon p = {others['wilcoxon']:.2g}, ttest_ind p = {others['ttest_ind']:.2g}"
    )
    is_signed = dtype == np.int64
    if is_signed:
        right = others
    assert (test.pvalue > 0.05) == is_signed
    assert (max(one_sided) < 1e-20) == (not is_signed)
    for name, value in others.items():
        assert np.isclose(value, right[name]) == (is_signed or is_new or name != "wilcoxon"), name
PYTHON
done
