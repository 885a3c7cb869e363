#!/usr/bin/env bash
# scikit-learn's median error of a depth map that is 20 mm off is 65,509 mm; its mean error is 20 mm.
#
# Software: scikit-learn 1.9.1 with numpy 2.4.6, and 1.5.2 with numpy 1.26.4.
#
# Depths in millimetres come as uint16, from a 16-bit PNG file or a ROS image of "16UC1". scikit-learn
# 1.9 makes floats of them in `mean_absolute_error`, `mean_squared_error`, `r2_score` and its other
# scores of a regression, but in `median_absolute_error` and `max_error` it subtracts uint16: where the
# prediction is 5 mm too near, the error is 65,531. One takes the median because a few wild pixels do
# not move it. With every tenth pixel too near it is 21 for 20, with half of them 32,768, and with 60%
# of them 65,509. `max_error`, which subtracts the other way round, is 65,526 as soon as one pixel is
# too far. Nothing is raised or warned of. In 1.5 the mean error was wrong as well (39,318), which
# is seen at once; in 1.9 one column of a report is wrong beside right ones.
#
# As float or int32 the same depths have the right values by all of them.
#
# Source: both functions in sklearn/metrics/_regression.py subtract what `_check_reg_targets` returns, the
# others what `_check_reg_targets_with_floating_dtype` returns. Issue 28827 of scikit-learn/scikit-learn,
# closed, is about `mean_squared_error` of uint8.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.9.1 1.5.2; do
  [ $version = 1.9.1 ] && numpy=2.4.6 || numpy=1.26.4
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scikit-learn==$version numpy==$numpy
  "$folder/$version/bin/python" -W error - <<'PYTHON'
import numpy as np
import sklearn
from sklearn import metrics

is_new = sklearn.__version__ == "1.9.1"
rng = np.random.default_rng(0)
truth = rng.integers(1000, 40_000, 4800).astype(np.uint16)
size = rng.integers(10, 31, truth.size)  # Of the error, in millimetres.
SCORES = ("mean_absolute_error", "mean_squared_error", "r2_score", "median_absolute_error", "max_error")
print(f"scikit-learn {sklearn.__version__}")
for share in (0, 0.1, 0.5, 0.6):
    too_near = np.arange(truth.size) < share * truth.size
    predicted = (truth + np.where(too_near, -size, size)).astype(np.uint16)
    print(f"  {share:.0%} of the pixels too near")
    for name in SCORES:
        score = getattr(metrics, name)
        by_integer, by_float = score(truth, predicted), score(truth.astype(float), predicted.astype(float))
        assert score(truth.astype(np.int32), predicted.astype(np.int32)) == by_float
        print(f"    {name}: {by_integer:.6g} as uint16, {by_float:.6g} as float")
        is_right = np.isclose(by_integer, by_float)
        if name in ("mean_squared_error", "r2_score") or share == 0 and name != "max_error":
            continue
        if name == "max_error":
            assert not is_right and by_integer > 65_000
        elif name == "median_absolute_error":
            assert not is_right and (by_integer > 30_000) == (share >= 0.5)
        else:
            assert is_right == is_new
PYTHON
done
