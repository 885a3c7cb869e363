#!/usr/bin/env bash
# pyarrow's `store_schema=False` drops the metadata of a table, not only Arrow's copy of the schema.
#
# Software: pyarrow 26.0.1.
#
# A table gets metadata of its own by `replace_schema_metadata`, such as the version of its format.
# `write_table` puts it into the Parquet file beside the key ARROW:schema, which holds Arrow's copy of
# the schema. `store_schema=False` leaves that key out, as its documentation says, which makes a file
# of three rows and twelve columns a third smaller. The table's own metadata are left out with it: the
# file has none at all, and nothing is raised. Column types that Parquet knows come back the same, so
# that nothing else shows it.
#
# `ParquetWriter.add_key_value_metadata` writes them in either case.
#
# Source: FileWriterImpl in cpp/src/parquet/arrow/writer.cc takes the metadata of the schema together
# with the schema: GetSchemaMetadata returns none of both unless the schema is to be stored.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check pyarrow==26.0.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

OWN = {b"format": b'{"name": "rates", "version": 3}'}
columns = {f"rate_{number}": [0.25, 0.5, 0.75] for number in range(12)}
table = pa.table(columns).replace_schema_metadata(OWN)


def stated(path):
    """Return the keys of the file's metadata, and print them with the file's size."""
    keys = sorted(parquet.read_metadata(path).metadata or {})
    print(f"{path}: {Path(path).stat().st_size} bytes, metadata {keys}")
    assert parquet.read_table(path).equals(table)
    return keys


parquet.write_table(table, "with.parquet")
parquet.write_table(table, "without.parquet", store_schema=False)
with parquet.ParquetWriter("added.parquet", table.schema, store_schema=False) as writer:
    writer.write_table(table)
    writer.add_key_value_metadata(OWN)

assert stated("with.parquet") == [b"ARROW:schema", b"format"]
assert stated("without.parquet") == []
assert stated("added.parquet") == [b"format"]
assert parquet.read_table("without.parquet").schema.metadata is None
assert parquet.read_table("added.parquet").schema.metadata == OWN
PYTHON
