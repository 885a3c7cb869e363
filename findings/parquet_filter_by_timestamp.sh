#!/usr/bin/env bash
# A Parquet filter for the very time of a row does not find the row if the time is a pandas Timestamp.
#
# Software: pyarrow 26.0.1, pandas 3.1.1, DuckDB 2.0.1, Polars 2.1.0.
#
# A table of a log has a column of nanoseconds, timestamp[ns]. A time comes from the same file, as
# `table["time"][1].as_py()` or as a cell of a pandas frame, and is a pandas.Timestamp with all its
# nanoseconds. `pandas.read_parquet(filters=[("time", "==", time)])`, pyarrow's `read_table`, `filter`
# and `compute.equal`, DuckDB's `WHERE time = ?` and Polars' `is_in([time])` find no row; Polars' `==`
# finds it. `>` includes the row and `<=` leaves it out, so that "all after the last one" has the last
# one again. Nothing is raised. Times of whole microseconds, as tests write them, work. A table that is
# made of such values, by `Table.from_pylist(table.to_pylist())` or `polars.DataFrame`, has
# microseconds, and the rest of each time is lost without a word.
#
# A numpy.datetime64 and a pyarrow scalar with its type are taken exactly, by pyarrow and pandas.
#
# Source: `pa.scalar(pandas.Timestamp(...)).type` is timestamp[us], whatever the `unit` of the value:
# without a type, a Timestamp is taken for the datetime.datetime that it inherits from.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  pyarrow==26.0.1 pandas==3.1.1 duckdb==2.0.1 polars==2.1.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
from pyarrow import compute, parquet

START = 1_764_000_000_123_456_000
ODD = [START + 100_000_000 * n + 789 for n in range(3)]
EVEN = [START + 100_000_000 * n for n in range(3)]  # whole microseconds


def written(times):
    table = pa.table({"time": pa.array(times, pa.timestamp("ns")), "frame": [0, 1, 2]})
    parquet.write_table(table, "log.parquet")
    return parquet.read_table("log.parquet")


def read(operator, time):
    return parquet.read_table("log.parquet", filters=[("time", operator, time)])["frame"].to_pylist()


def by_pandas(time):
    return pd.read_parquet("log.parquet", filters=[("time", "==", time)])["frame"].tolist()


def by_filter(time):
    return table.filter(compute.field("time") == time)["frame"].to_pylist()


def by_duckdb(time):
    rows = duckdb.execute("SELECT frame FROM 'log.parquet' WHERE time = ?", [time]).fetchall()
    return [frame for (frame,) in rows]


def by_polars(condition):
    return pl.scan_parquet("log.parquet").filter(condition).collect()["frame"].to_list()


print("pyarrow", pa.__version__, "pandas", pd.__version__, end=" ")
print("DuckDB", duckdb.__version__, "Polars", pl.__version__)
for times, found in ((ODD, []), (EVEN, [1])):
    table = written(times)
    time = table["time"][1].as_py()
    assert isinstance(time, pd.Timestamp) and time.unit == "ns" and time.value == times[1]
    assert time == table.to_pandas()["time"][1]
    answers = {
        "pandas.read_parquet": by_pandas(time),
        "pyarrow read_table": read("=", time),
        "pyarrow filter": by_filter(time),
        "DuckDB": by_duckdb(time),
        "Polars is_in": by_polars(pl.col("time").is_in([time])),
    }
    print(f"{time}: {answers}")
    assert all(answer == found for answer in answers.values())
    assert compute.any(compute.equal(table["time"], time)).as_py() == bool(found)
    assert by_polars(pl.col("time") == time) == [1]
    for exact in (np.datetime64(times[1], "ns"), table["time"][1]):
        assert by_pandas(exact) == read("=", exact) == by_filter(exact) == [1]

table = written(ODD)
time = table["time"][1].as_py()
print(f"read_table: > {read('>', time)}, <= {read('<=', time)}, < {read('<', time)}")
assert (read(">", time), read("<=", time)) == ([1, 2], [0])
print("pa.scalar:", pa.scalar(time).type)
assert pa.scalar(time).type == pa.timestamp("us")
again = pa.Table.from_pylist(table.to_pylist())["time"]
by_rows = pl.DataFrame({"time": table["time"].to_pylist()})["time"]
print("made again of its values:", again.type, "and", by_rows.dtype)
cut = [time // 1000 for time in ODD]
assert again.cast(pa.int64()).to_pylist() == cut
assert by_rows.dtype == pl.Datetime("us") and by_rows.to_physical().to_list() == cut
PYTHON
