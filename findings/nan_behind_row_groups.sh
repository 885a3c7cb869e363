#!/usr/bin/env bash
# DuckDB finds other rows with NaN in a Parquet file than in a table, and `isnan` finds none at all.
#
# Software: duckdb 2.0.1, with files by pyarrow 26.0.1, polars 2.1.0 and pandas 3.1.1.
#
# A table of rates has a value for each frame, and NaN where a rate is undefined, as where a frame
# has no road. DuckDB holds NaN for greater than every number and says so. In a table, four queries
# answer by that rule. Of the same values in a Parquet file by pyarrow or Polars they do not:
#
#                           table   file, one row group   file, two row groups
#     isnan(rate)               2                     0                      0
#     rate > 0.95               2                     0                      0
#     rate between 0 and 1      6                     8                      8
#     rate >= 0.5               5                     5                      4
#
# The check that was to find bad rates takes NaN for a good one, the search for NaN finds none, and
# the rows over a limit depend on how the writer cut the file. Nothing is raised. A file that pandas
# writes has NULL in place of NaN, and one that DuckDB writes has no smallest and greatest value of a
# column with NaN; both are answered as tables are, so a test with such a file shows nothing.
# `PRAGMA disable_optimizer` gives the table's answers, and so does NULL for NaN in the file.
#
# Source: the Parquet format leaves NaN out of the smallest and greatest value of a row group
# (ColumnOrder in parquet.thrift: a reader must not trust them where it looks for NaN); issue 25521 of
# duckdb/duckdb, open in November 2026.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  duckdb==2.0.1 pyarrow==26.0.1 polars==2.1.0 pandas==3.1.1 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
from pyarrow import parquet

NAN = float("nan")
RATES = [0.1, 0.2, NAN, 0.3, 0.9, 0.8, NAN, 0.7]
QUERIES = ("isnan(rate)", "rate > 0.95", "rate between 0 and 1", "rate >= 0.5")

table = pa.table({"rate": RATES})
parquet.write_table(table, "pyarrow_1.parquet")
parquet.write_table(table, "pyarrow_2.parquet", row_group_size=4)
pl.DataFrame({"rate": RATES}).write_parquet("polars_1.parquet")
pl.DataFrame({"rate": RATES}).write_parquet("polars_2.parquet", row_group_size=4)
pd.DataFrame({"rate": RATES}).to_parquet("pandas.parquet")
database = duckdb.connect()
database.execute("create table rates as select * from 'pyarrow_1.parquet'")
database.execute("copy rates to 'duckdb.parquet'")


def rows(source):
    """Return the number of rows that each query yields, and print it."""
    numbers = [
        len(database.execute(f"select rate from {source} where {query}").fetchall())
        for query in QUERIES
    ]
    print(f"{source:>20}: {dict(zip(QUERIES, numbers))}")
    return numbers


print("duckdb", duckdb.__version__, "pyarrow", pa.__version__, "polars", pl.__version__)
by_rule = [2, 2, 6, 5]
assert rows("rates") == by_rule
assert rows("'duckdb.parquet'") == by_rule
assert rows("'pyarrow_1.parquet'") == rows("'polars_1.parquet'") == [0, 0, 8, 5]
assert rows("'pyarrow_2.parquet'") == rows("'polars_2.parquet'") == [0, 0, 8, 4]
assert rows("'pandas.parquet'") == [0, 0, 6, 3]  # NULL is in no answer
for group in range(2):
    column = parquet.ParquetFile("pyarrow_2.parquet").metadata.row_group(group).column(0)
    stated = column.statistics.min, column.statistics.max
    print(f"row group {group} of pyarrow_2.parquet states {stated[0]} to {stated[1]}")
    assert stated == ((0.1, 0.3), (0.7, 0.9))[group]

database.execute("PRAGMA disable_optimizer")
print("without the optimizer:")
for name in ("pyarrow_1", "pyarrow_2", "polars_1", "polars_2"):
    assert rows(f"'{name}.parquet'") == by_rule
PYTHON
