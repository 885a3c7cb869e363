#!/usr/bin/env bash
# scikit-image 0.26 takes `min_size=4` as "remove objects of 4 pixels, too"; its warning says it does not.
#
# Software: scikit-image 0.26.0, against 0.25.2; with numpy 2.4.6.
#
# `remove_small_objects(mask, min_size=4)` removed objects of fewer than four pixels, and kept those of
# four, in all versions up to 0.25. Version 0.26 renames the argument to `max_size`, which removes
# objects of so many pixels, too. Who still writes `min_size` gets a FutureWarning: the new argument
# removes objects smaller than or equal to its value, "while the previous parameter only removed
# smaller ones". It reads as if the call at hand still did. It does not: the value is handed over as
# `max_size`, and objects of exactly four pixels are gone. The same holds for a value in second
# place, for `area_threshold` of `remove_small_holes`, and for the default of 64, which gives no
# warning at all. Masks change with an update; counts of objects, false alarms and recall by object
# change with them, most where a size is typical: blocks of 8x8 pixels, squares of a coarse map.
#
# `max_size=3` in place of `min_size=4` gives the masks of before.
#
# Source: skimage/morphology/misc.py of 0.26.0. The decorator `deprecate_parameter` with a new name
# hands the value over, so that the branch "Exclusive threshold is deprecated behavior" inside the
# function is never taken; its docstring says that `min_size` "only removed objects strictly smaller".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 0.25.2 0.26.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scikit-image==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import warnings

import numpy as np
import skimage
from skimage.morphology import remove_small_holes, remove_small_objects

blocks = np.zeros((80, 120), bool)
blocks[8:16, 8:16] = True  # 64 pixels
blocks[40:48, 40:49] = True  # 72 pixels
is_new = skimage.__version__ == "0.26.0"


def removed(call, *args, **options):
    """Return which sizes of objects, or of holes, a call removes, and its warnings."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        changed = call(*args, **options) != args[0]
    sizes = [size for size, part in ((64, np.s_[:30]), (72, np.s_[30:])) if changed[part].sum() == size]
    assert sum(sizes) == changed.sum()
    return sizes, [str(warning.message) for warning in said]


calls = {
    "min_size=64": removed(remove_small_objects, blocks, min_size=64),
    "64 in second place": removed(remove_small_objects, blocks, 64),
    "the default": removed(remove_small_objects, blocks),
    "holes, area_threshold=64": removed(remove_small_holes, ~blocks, area_threshold=64),
}
for words, (sizes, said) in calls.items():
    print(f"scikit-image {skimage.__version__}, {words}: removes {sizes or 'nothing'}, {len(said)} warnings")
    assert sizes == ([64] if is_new else [])
    assert len(said) == (is_new and words != "the default")
if is_new:
    (sentence,) = calls["min_size=64"][1]
    print(f"  its warning: ... {sentence[sentence.index('Note') :]}")
    assert "while the previous parameter only removed smaller ones" in sentence
    assert removed(remove_small_objects, blocks, max_size=63) == ([], [])
PYTHON
done
