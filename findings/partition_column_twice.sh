#!/usr/bin/env bash
# pandas cannot read a folder of Parquet files whose folders are named for a column that they have.
#
# Software: pandas 3.1.1 with pyarrow 26.0.1.
#
# A data set lies in folders drive=a1 and drive=b2, as Hive and Spark name them, and its files say
# their drive in a column `drive` as well, so that each is complete by itself. `pandas.read_parquet`
# of the folder takes neither of the two: it raises ArrowTypeError ("Unable to merge: Field drive has
# incompatible types"). Both are text, but the column of the folders is a dictionary of words, that
# of the files plain words, and pyarrow merges the two schemas. Numbers (drive=1, and a column of
# whole numbers) end the same way. With `partitioning=None` the column of the files is read.
#
# Source: pandas.read_parquet hands the folder to pyarrow.parquet.read_table, whose `partitioning` is
# "hive" by default (documentation of pyarrow.parquet.read_table).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check pandas==3.1.1 pyarrow==26.0.1
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from pathlib import Path

import pandas as pd
import pyarrow as pa

print("pandas", pd.__version__, "pyarrow", pa.__version__)


def written(name, folders):
    place = Path(sys.argv[1], name)
    for folder, own in folders.items():
        (place / folder).mkdir(parents=True)
        pd.DataFrame({"drive": [own], "ERR": [0.1]}).to_parquet(place / folder / "frames.parquet")
    return place


KINDS = {
    "text": {"drive=a1": "monday", "drive=b2": "tuesday"},
    "numbers": {"drive=1": 71, "drive=2": 72},
}
for kind, folders in KINDS.items():
    place = written(kind, folders)
    try:
        pd.read_parquet(place)
    except pa.ArrowTypeError as error:
        print(f"{kind}: {error}")
        assert "Unable to merge: Field drive has incompatible types" in str(error)
    else:
        raise SystemExit(f"{kind}: the folder is read now")
    own = pd.read_parquet(place, partitioning=None)["drive"].tolist()
    print(f"{kind}, partitioning=None: {own}")
    assert own == list(folders.values())
PYTHON
