#!/usr/bin/env bash
# Polars' sum of a group of float32 is a percent off, and how much depends on the number of cores.
#
# Software: polars 2.1.0, against duckdb 2.0.1, pandas 3.1.1 and pyarrow 26.0.1; with numpy 2.4.6.
#
# A table has a million frames, each with the 0.1 m that the car moved in it, as float32. The sum of
# the column is 100,000 m. The sum by drive, `group_by("drive").agg(pl.col("moved").sum())`, with
# one drive in the table, is 100,958 m with one thread and 100,354 m or so with two. With the column
# `drive` marked as sorted (`set_sorted`), or by `sum().over("drive")`, it is 100,000 m again, and
# so is the mean times the number, by the same `group_by`. DuckDB, pandas and pyarrow have 100,000 m
# for the group, too. So a distance, an area or a sum of a loss by drive differs between two
# computers and from the sum of all, by more than two methods differ, and mean and sum of one table
# contradict each other. The error is 0.01 % with ten drives of 100,000 frames each, and cannot be
# seen in a short test.
#
# `pl.col("moved").cast(pl.Float64).sum()` is right.
#
# Source: the numbers of each. Polars keeps float32 for the sum of a group and adds one row after
# the other; `mean` adds in float64, and the sum of a whole column is pairwise (issue 10553 of
# pola-rs/polars). Issue 27662, open in November 2026, has the like for `cum_sum`.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  polars==2.1.0 duckdb==2.0.1 pandas==3.1.1 pyarrow==26.0.1 numpy==2.4.6
cat > "$folder/sums.py" <<'PYTHON'
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa

rows = 1_000_000
moved = np.full(rows, 0.1, np.float32)
true = moved.astype(np.float64).sum()


def group(table, what):
    """Value of the first drive."""
    return table.group_by("drive").agg(what).sort("drive")["moved"][0]


column = pl.col("moved")
table = pl.DataFrame({"drive": np.zeros(rows, np.int32), "moved": moved})
in_order = table.with_columns(pl.col("drive").set_sorted())
by_duckdb = "select sum(moved) from table_ group by drive"
table_ = pa.table({"drive": np.zeros(rows, np.int32), "moved": moved})
sums = {
    "column": table["moved"].sum(),
    "group": group(table, column.sum()),
    "group, streaming": table.lazy()
    .group_by("drive")
    .agg(column.sum())
    .collect(engine="streaming")["moved"][0],
    "group, marked as sorted": group(in_order, column.sum()),
    "over": table.select(column.sum().over("drive"))["moved"][0],
    "mean of group times rows": group(table, column.mean()) * rows,
    "group, cast to Float64": group(table, column.cast(pl.Float64).sum()),
    "DuckDB": duckdb.sql(by_duckdb).fetchall()[0][0],
    "pandas": pd.DataFrame({"drive": 0, "moved": moved}).groupby("drive")["moved"].sum()[0],
    "pyarrow": table_.group_by("drive").aggregate([("moved", "sum")])["moved_sum"][0].as_py(),
}
print(f"Polars {pl.__version__}, {pl.thread_pool_size()} threads")
for name, value in sums.items():
    print(f"  {name}: {value:,.1f} m")
    wrong = name in ("group", "group, streaming") and pl.thread_pool_size() == 1
    unknown = name in ("group", "group, streaming") and not wrong
    assert unknown or (0.005 < value / true - 1 < 0.02 if wrong else abs(value / true - 1) < 1e-6)
ten = table.with_columns(drive=pl.int_range(pl.len()) // 100_000)
error = group(ten, column.sum()) / moved[:100_000].astype(np.float64).sum() - 1
print(f"  group, ten drives: {error:+.3%}")
assert 1e-5 < abs(error) < 1e-3
PYTHON
for threads in 1 2 8; do
  POLARS_MAX_THREADS=$threads "$folder/venv/bin/python" "$folder/sums.py"
done
