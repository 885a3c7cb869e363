#!/usr/bin/env bash
# statsmodels' McNemar test of two methods that agree on every pixel has p = 0: "they differ, surely".
#
# Software: statsmodels 0.15.0, with numpy 2.4.6, scipy 1.17.1 and pandas 3.1.1.
#
# McNemar's test compares two methods by the pixels that only one of them has right, b and c. For
# large numbers its chi-square form is the usual one (`exact=False`). A filter that changes nothing in
# a frame leaves b = c = 0. With the default `correction=True` the statistic is then infinite and the
# p-value 0.0, the strongest result that there is, and a correction for many frames
# (`multipletests`) keeps it in front of all others. A NumPy warning, "divide by zero", is all that
# tells. `exact=True` gives 1.0, and `correction=False` gives nan.
#
# Near it the correction works in the wrong direction, too: b = c = 1, two methods that are alike in
# all that can be seen, has p = 0.48, where b = 1 and c = 0 has 1.0. A script that keeps the frames
# with p < 0.05 lists those in which nothing happened.
#
# Source: statsmodels/stats/contingency_tables.py computes (|b - c| - 1)^2 / (b + c) for every b and c.
# The documentation says of `exact=False` that it is the approximation for large samples, and nothing
# of b + c = 0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  statsmodels==0.15.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1
"$folder/venv/bin/python" - <<'PYTHON'
import math
import warnings

import numpy as np
import statsmodels
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests

SIZE = 480, 640
truth = np.zeros(SIZE, bool)
truth[240:] = True
before = truth.copy()
before[240:250] = False  # ten rows of road are missed


def p_value(before, after, **options):
    """Return the p-value of McNemar's test of two masks, and the warnings."""
    was_right, is_right = before == truth, after == truth
    table = [[(was & now).sum() for now in (is_right, ~is_right)] for was in (was_right, ~was_right)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        value = mcnemar(np.array(table), **options).pvalue
    return float(value), [str(warning.message) for warning in caught]


print("statsmodels", statsmodels.__version__)
unchanged, said = p_value(before, before, exact=False)
print(f"a filter that changes no pixel, exact=False: p = {unchanged}, warnings {said}")
assert unchanged == 0
assert said == ["divide by zero encountered in scalar divide"]
assert p_value(before, before, exact=True)[0] == 1
assert math.isnan(p_value(before, before, exact=False, correction=False)[0])

better = before.copy()
better[245, 5] = True  # one pixel of road comes back ...
exchanged = better.copy()
exchanged[300, 5] = False  # ... and another one is lost
for name, after, expected in (("one pixel", better, 1.0), ("one for one", exchanged, 0.4795)):
    value = p_value(before, after, exact=False)[0]
    print(f"{name}: p = {value:.4f} with exact=False, {p_value(before, after)[0]:.4f} with exact=True")
    assert round(value, 4) == expected and p_value(before, after)[0] == 1

some = before.copy()
some[245, :12] = True  # a change of twelve pixels, all for the better
frames = [p_value(before, after, exact=False)[0] for after in (before, before, some, exchanged)]
differ = multipletests(frames, method="fdr_bh")[0].tolist()
print(f"p-values of four frames {[round(p, 4) for p in frames]}; said to differ: {differ}")
assert differ == [True, True, True, False]  # in the first two nothing changed
PYTHON
