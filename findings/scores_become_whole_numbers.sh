#!/usr/bin/env bash
# DuckDB reads a folder of Parquet files with scores of 0.7 as 1, if the first file has whole numbers.
#
# Software: duckdb 2.0.1, with files by pandas 3.1.1; against pyarrow 26.0.1 and Polars 2.1.0.
#
# One Parquet file per drive has the score of each frame. A drive in which every score is 0 or 1 is
# written by pandas with a column of whole numbers, all others with fractions. DuckDB takes the types
# from the first file by name. If that is such a drive, `SELECT ... FROM 'drives/*.parquet'` rounds all
# scores of all other drives, without a word: the mean of the town in the example goes from 0.65 to
# 0.75, and one frame is below 0.7 where two are. Which folder is hit depends on its first file alone,
# so one more drive with a name in front of the others changes every number of a report. Halves go
# to the even number: 0.5 to 0, 1.5 and 2.5 to 2. At the prompt this looks otherwise: `SELECT 2.5::INT`
# is 3, as the literal 2.5 is a decimal number, which is rounded away from 0.
#
# One JSON file has the same behind the sample that DuckDB takes: a frame with 0.7 after enough frames
# with 0 and 1 has the score 1.
#
# pyarrow and pandas raise ("was truncated converting to int64"), and so does Polars. DuckDB itself is
# right with `union_by_name = true`, and if the file with the fractions comes first.
#
# Source: DuckDB's page "Combining Schemas" says that the schema of the first file is read, and nothing
# of values that its types cannot hold; where a cast fails (a text for a number), DuckDB raises. Issues
# 25786 and 25824 of duckdb/duckdb, open in November 2026, have JSON and CSV files behind the sample.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  duckdb==2.0.1 pandas==3.1.1 pyarrow==26.0.1 polars==2.1.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import json
from pathlib import Path

import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.dataset

print(
    f"DuckDB {duckdb.__version__}, pandas {pd.__version__}, "
    f"pyarrow {pa.__version__}, Polars {pl.__version__}"
)
DRIVES = {"b_town": [0.6, 0.4, 0.7, 0.9], "c_rain": [0.5, 1.5, 2.5, 0.2]}
FILES = "drives/*.parquet"
Path("drives").mkdir()


def write(drive, scores):
    pd.DataFrame({"drive": drive, "score": scores}).to_parquet(f"drives/{drive}.parquet")


def ask(query):
    return duckdb.sql(query).fetchall()


def scores(drive, source=f"'{FILES}'"):
    return [score for (score,) in ask(f"SELECT score FROM {source} WHERE drive = '{drive}'")]


for drive, values in DRIVES.items():
    write(drive, values)
assert all(scores(drive) == values for drive, values in DRIVES.items())
counted = "round(avg(score), 2), count(*) FILTER (score < 0.7)"
town = f"SELECT {counted} FROM '{FILES}' WHERE drive = 'b_town'"
before = ask(town)[0]
print(f"two drives: scores of the town {scores('b_town')}, mean and frames below 0.7: {before}")
assert before == (0.65, 2)

write("a_car_park", [1, 0])  # one more drive, and nothing but 0 and 1 in it
after = ask(town)[0]
print(f"with a third one: {scores('b_town')}, {after}; rain {scores('c_rain')}")
assert after == (0.75, 1) and scores("b_town") == [1, 0, 1, 1]
assert scores("c_rain") == [0, 2, 2, 0]
assert ask("SELECT 2.5::INT, 2.5::DOUBLE::INT") == [(3, 2)]

whole = f"read_parquet('{FILES}', union_by_name = true)"
assert all(scores(drive, whole) == values for drive, values in DRIVES.items())
last = "read_parquet(['drives/b_town.parquet', 'drives/a_car_park.parquet'])"
assert scores("b_town", last) == DRIVES["b_town"]  # the order of the files decides
for name, read in (
    ("pandas", lambda: pd.read_parquet("drives")),
    ("pyarrow", lambda: pyarrow.dataset.dataset("drives").to_table()),
    ("Polars", lambda: pl.read_parquet(FILES)),
):
    try:
        read()
    except (pa.ArrowInvalid, pl.exceptions.SchemaError) as error:
        print(f"{name}: {type(error).__name__}: {str(error).splitlines()[0]}")
    else:
        raise SystemExit(f"{name} reads such a folder now")

rows = [{"frame": frame, "score": frame % 2} for frame in range(200_000)]
rows += [{"frame": 200_000 + i, "score": score} for i, score in enumerate(DRIVES["b_town"])]
Path("scores.json").write_text("\n".join(map(json.dumps, rows)))
for source, wanted in (
    ("'scores.json'", [1, 0, 1, 1]),
    ("read_json('scores.json', sample_size = -1)", DRIVES["b_town"]),
):
    late = [score for (score,) in ask(f"SELECT score FROM {source} WHERE frame >= 200000")]
    print(f"{source}: {late}")
    assert late == wanted
PYTHON
