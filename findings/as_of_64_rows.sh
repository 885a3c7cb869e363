#!/usr/bin/env bash
# DuckDB's ASOF JOIN takes the first of two labels of one time for 63 pictures, the last for 64.
#
# Software: DuckDB 2.0.1, against pandas 3.1.1 and Polars 2.1.0.
#
# A table of labels has two rows for each time, "old" and then "new", as where a label was corrected
# and the new row was appended. Each picture is joined with the last label before it. `merge_asof` of
# pandas and `join_asof` of Polars take the row that comes last, "new". DuckDB takes "old" as long as
# there are at most 63 rows on the left, and "new" from 64 rows on, by the same query on the same
# labels. A test with a short table, and the first ten pictures of a drive by `LIMIT 10`, have other
# labels than the same pictures have in the whole drive. Nothing is raised. The times of both rows are
# the same, so a check of the times does not show it.
#
# The setting `asof_loop_join_threshold`, which is 64, says from which number on another method is
# used. Who needs one of the two has to leave the other out before the join, as by QUALIFY.
#
# Source: the plans, as EXPLAIN prints them: a join by nested loops with `arg_max_null`, and an ASOF
# join. DuckDB's issue 25536 has it that rows of equal time come in no order, and was closed as
# expected behaviour.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  duckdb==2.0.1 pandas==3.1.1 polars==2.1.0 pyarrow==26.0.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import duckdb
import numpy as np
import pandas as pd
import polars as pl

PERIOD = 100_000_000  # ns
LABELS = 1000
QUERY = "SELECT label FROM pictures ASOF JOIN labels ON pictures.time >= labels.time"

labels = pd.DataFrame(
    {
        "time": np.repeat(np.arange(LABELS) * PERIOD, 2),
        "label": ["old", "new"] * LABELS,
    }
)
database = duckdb.connect(config={"threads": 1})
database.register("labels", labels)


def taken(count):
    """Return the labels that so many pictures get, by library."""
    pictures = pd.DataFrame({"time": np.arange(count) * PERIOD + PERIOD // 5})
    database.register("pictures", pictures)
    joined = pl.from_pandas(pictures).join_asof(pl.from_pandas(labels), on="time")
    return {
        "DuckDB": {label for (label,) in database.sql(QUERY).fetchall()},
        "pandas": set(pd.merge_asof(pictures, labels, on="time")["label"]),
        "Polars": set(joined["label"]),
    }


print("DuckDB", duckdb.__version__, "pandas", pd.__version__, "Polars", pl.__version__)
for count in (1, 10, 63, 64, 65, 500):
    found = taken(count)
    print(f"{count} pictures:", {name: ", ".join(words) for name, words in found.items()})
    assert found["DuckDB"] == ({"old"} if count < 64 else {"new"})
    assert found["pandas"] == found["Polars"] == {"new"}
first_ten = QUERY.replace("pictures ASOF", "(FROM pictures LIMIT 10) AS pictures ASOF")
labels_of_ten = {label for (label,) in database.sql(first_ten).fetchall()}
print(f"the first 10 of these {count} pictures:", labels_of_ten)
assert labels_of_ten == {"old"}
((threshold,),) = database.sql("SELECT current_setting('asof_loop_join_threshold')").fetchall()
print("asof_loop_join_threshold:", threshold)
assert int(threshold) == 64
PYTHON
