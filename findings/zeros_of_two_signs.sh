#!/usr/bin/env bash
# pyarrow's 0.0 and -0.0 are equal in a filter, and two groups, two values and no match in a join.
#
# Software: pyarrow 26.0.1, against pandas 3.1.1, Polars 2.1.0 and DuckDB 2.0.1; numpy 2.4.6.
#
# A steering angle is rounded to 0.1 to group frames by it. NumPy rounds -0.04 to -0.0 and 0.04 to
# 0.0, so frames that go straight on have both. `group_by` of pyarrow makes two groups of them, which
# print as 0 and -0. `unique`, `value_counts` and `count_distinct` count them as two; `is_in` and a
# `join` with the value 0.0 leave all frames of -0.0 out, half of those that go straight on. A
# filter for `angle == 0` has all of them. So has every comparison, and so have pandas, Polars and
# DuckDB in each of these operations.
#
# pandas hands a column of the type `double[pyarrow]` to the same code: `value_counts`, `unique` and
# `groupby` of it have two zeros, which its own float64 has not. A mirrored recording has them as
# well, as -1 * 0.0 is -0.0. NaN is one group, but for its sign: a second NaN with the sign bit set,
# as 0.0 / 0.0 is on many processors, is another. `angle + 0.0` makes every zero 0.0.
#
# Source: the values of one column. The documentation of group_by, join and unique says nothing of the
# sign of zero, and the specification of IEEE 754 says that both are equal. Issue 26214 of
# apache/arrow, open in November 2026, names the two entries of a dictionary.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  pyarrow==26.0.1 pandas==3.1.1 polars==2.1.0 duckdb==2.0.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.compute as pc

print(
    f"pyarrow {pa.__version__}, pandas {pd.__version__}, Polars {pl.__version__}, "
    f"DuckDB {duckdb.__version__}, NumPy {np.__version__}"
)
angles = np.round([0.04, -0.04, 0.01, -0.02, 0.1], 1)
frames = pa.table({"angle": angles, "iou": [0.9, 0.5, 0.9, 0.5, 0.7]})
straight = pa.table({"angle": [0.0], "name": ["straight on"]})
print("angles:", angles.tolist())

groups = frames.group_by("angle").aggregate([("iou", "mean"), ("iou", "count")]).to_pylist()
groups = {str(group["angle"]): (group["iou_count"], group["iou_mean"]) for group in groups}
print("pyarrow, groups:", groups)
assert groups == {"0.0": (2, 0.9), "-0.0": (2, 0.5), "0.1": (1, 0.7)}
assert frames.filter(pc.field("angle") == 0).num_rows == 4
column = frames["angle"]
assert pc.equal(column, 0.0).to_pylist() == [True, True, True, True, False]
assert pc.is_in(column, value_set=pa.array([0.0])).to_pylist() == [True, False, True, False, False]
assert len(pc.unique(column)) == len(pc.value_counts(column)) == 3
assert pc.count_distinct(column).as_py() == 3
joined = frames.join(straight, "angle", join_type="inner")
print("pyarrow, join with 0.0:", joined.num_rows, "of 4 frames")
assert joined.num_rows == 2

own = frames.to_pandas()
print("pandas, groups:", own.groupby("angle").size().to_dict())
assert own.groupby("angle").size().tolist() == own["angle"].value_counts().tolist() == [4, 1]
assert len(own["angle"].unique()) == 2 and own["angle"].isin([0.0]).sum() == 4
assert len(own.merge(straight.to_pandas(), on="angle")) == 4

arrow = frames.to_pandas(types_mapper=pd.ArrowDtype)
print("pandas, groups of double[pyarrow]:", list(arrow.groupby("angle").size().items()))
assert sorted(arrow.groupby("angle").size().tolist()) == [1, 2, 2]
assert len(arrow["angle"].unique()) == len(arrow["angle"].value_counts()) == 3
assert (arrow["angle"] == 0).sum() == 4 and arrow["angle"].isin([0.0]).sum() == 2

polars = pl.from_arrow(frames)
print("Polars, groups:", sorted(polars.group_by("angle").len().rows()))
assert sorted(polars.group_by("angle").len().rows()) == [(0.0, 4), (0.1, 1)]
assert polars["angle"].n_unique() == 2 and polars["angle"].is_in([0.0]).sum() == 4
assert polars.join(pl.from_arrow(straight), on="angle").height == 4

sql = duckdb.sql("SELECT angle, count(*) FROM frames GROUP BY angle ORDER BY angle").fetchall()
print("DuckDB, groups:", sql)
assert sql == [(0.0, 4), (0.1, 1)]
assert duckdb.sql("SELECT count(DISTINCT angle) FROM frames").fetchall() == [(2,)]
assert len(duckdb.sql("SELECT * FROM frames JOIN straight USING (angle)").fetchall()) == 4

both = pa.table({"iou": [np.nan, np.copysign(np.nan, -1), np.nan]})
sizes = both.group_by("iou").aggregate([([], "count_all")])["count_all"].to_pylist()
print("pyarrow, groups of NaN of two signs:", sizes)
assert sorted(sizes) == [1, 2] and pl.from_arrow(both)["iou"].n_unique() == 1

mended = frames.set_column(0, "angle", pc.add(column, 0.0))
sizes = mended.group_by("angle").aggregate([([], "count_all")])["count_all"].to_pylist()
assert sorted(sizes) == [1, 4]
assert mended.join(straight, "angle", join_type="inner").num_rows == 4
PYTHON
