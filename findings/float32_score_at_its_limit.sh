#!/usr/bin/env bash
# A float32 score of 0.9 is at least 0.9 or is not, by which library asks, and in which words.
#
# Software: numpy 2.4.6, pandas 3.1.1, pyarrow 26.0.1, polars 2.1.0, duckdb 2.0.1.
#
# A table has 1,000 scores of float32, rounded to two digits, ten of each of 0.00 to 0.99. How many
# are at least 0.9? As float32 0.9 is a little less than 0.9 as float64, so it depends on whether the
# limit is made a float32 first (100 scores) or the score a float64 (90):
#
#     numpy, with the limit 0.9       100        with np.float64(0.9)      90
#     pandas                          100        with pandas.ArrowDtype    90
#     polars, with the limit 0.9      100        with np.float64(0.9)      90
#     duckdb, with 0.9 in the query   100        with 0.9 as a parameter   90
#     pyarrow                          90
#
# So one table has two answers within each of four libraries: a limit from `numpy.linspace` or from
# another column is a float64, one that is typed is not. The limits of half of all hundredths behave
# like 0.9; 0.5 and 0.3 do not, so a test at 0.5 shows nothing. Scores that come from a quantised
# network or were rounded lie on such limits by the hundreds.
#
# A column of float64, or a limit that is made a float32 (`numpy.float32(0.9)`, `cast(? as float)`),
# gives one answer everywhere.
#
# Source: the counts of all nine. NumPy's NEP 50 explains the first line; issue 229 of
# duckdb/duckdb-python, open in November 2026, has the fourth.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  numpy==2.4.6 pandas==3.1.1 pyarrow==26.0.1 polars==2.1.0 duckdb==2.0.1
"$folder/venv/bin/python" - <<'PYTHON'
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.compute as pc

for package in (np, pd, pa, pl, duckdb):
    print(package.__name__, package.__version__)
scores = np.repeat(np.arange(100) / 100, 10).astype(np.float32)
table = pa.table({"score": scores})
by_numpy = table.to_pandas()
by_arrow = table.to_pandas(types_mapper=pd.ArrowDtype)
frame = pl.from_arrow(table)
assert by_numpy["score"].dtype == np.float32 and by_arrow["score"].dtype == "float[pyarrow]"


def by_duckdb(condition, *parameters):
    query = f"select count(*) from table_of_scores where score >= {condition}"
    return database.execute(query, list(parameters)).fetchall()[0][0]


database = duckdb.connect()
database.register("table_of_scores", table)
AS_FLOAT32 = {
    "numpy, Python's float": lambda limit: (scores >= limit).sum(),
    "pandas": lambda limit: (by_numpy["score"] >= limit).sum(),
    "polars, Python's float": lambda limit: frame.filter(pl.col("score") >= limit).height,
    "duckdb, in the query": lambda limit: by_duckdb(limit),
    "duckdb, cast(? as float)": lambda limit: by_duckdb("cast(? as float)", limit),
}
AS_FLOAT64 = {
    "numpy, np.float64": lambda limit: (scores >= np.float64(limit)).sum(),
    "pandas, ArrowDtype": lambda limit: (by_arrow["score"] >= limit).sum(),
    "polars, np.float64": lambda limit: frame.filter(pl.col("score") >= np.float64(limit)).height,
    "duckdb, as a parameter": lambda limit: by_duckdb("?", limit),
    "pyarrow": lambda limit: pc.sum(pc.greater_equal(table["score"], limit)).as_py(),
}
for limit, expected in ((0.9, (100, 90)), (0.7, (300, 290)), (0.5, (500, 500)), (0.3, (700, 700))):
    print(f"scores of at least {limit}:")
    for ways, number in zip((AS_FLOAT32, AS_FLOAT64), expected):
        for name, count in ways.items():
            print(f"    {name}: {count(limit)}")
            assert count(limit) == number

limits = [number / 100 for number in range(1, 100)]
differ = [limit for limit in limits if float(np.float32(limit)) < limit]
print(f"{len(differ)} of {len(limits)} limits of two digits have two answers")
assert len(differ) == 50
assert all((scores >= x).sum() == (scores >= np.float64(x)).sum() + 10 for x in differ)
PYTHON
