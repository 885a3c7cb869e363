"""Documents from anybody: no small one takes long, fills the memory or ends in a traceback."""

import hashlib
import json
import shutil
import time

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from roadeval.results.facts import digest_of
from tests.e2e.commands import here
from tests.results.fleet.making import fleet_of

LINE = "word " * 20


@pytest.fixture
def folder(street, tmp_path):
    """A drive's results, to be changed."""
    return shutil.copytree(street.reports, tmp_path / "r")


def changed(path, **parts):
    """Write other parts into a document, and the digest that then fits."""
    content = json.loads(path.read_text()) | parts
    content["digest"] = digest_of(content, content["digest"]["parts"])
    path.write_text(json.dumps(content))


def refused(*words):
    """What is said of a result that is refused at once."""
    begun = time.process_time()
    done = here(*words)
    assert done.returncode == 1, done.stdout
    assert done.stderr.count("\n") == 1
    assert "defect" not in done.stderr
    assert time.process_time() - begun < 5
    return done.stderr


@pytest.mark.parametrize(
    ("part", "value", "reason"),
    [
        ("verdict", "x" * 1_000_000, "a text of 1,000,000 letters, and at most 12,000 are read"),
        ("warnings", [LINE] * 20_000, "a list in it has more than 1,000,000 letters"),
        ("warnings", ["x" * 12_000] * 50, "its long texts have more than 500,000 letters"),
        ("totals", {f"v{n}": {"post": {}} for n in range(150_000)}, "more than 200,000 values"),
    ],
)
def test_a_summary_that_holds_too_much_is_refused(folder, part, value, reason):
    changed(folder / "summary.json", **{part: value})
    words = {"report": ("-o", folder / "r.pdf"), "compare": (folder,), "inspect": ("--list",)}
    for command, more in words.items():
        assert reason in refused(command, folder, *more)


def test_a_table_of_thousands_of_variants_is_refused(folder):
    lines = (folder / "frames.csv").read_text().splitlines()
    rows = [line.replace("filtered", f"v{n}") for n in range(2_000) for line in lines[1:2]]
    (folder / "frames.csv").write_text("\n".join([lines[0], *rows, ""]))
    summary = json.loads((folder / "summary.json").read_text())
    tables = {name: each for name, each in summary["tables"].items() if name != "frames"}
    content = (folder / "frames.csv").read_bytes()
    stated = {"rows": content.count(b"\n") - 1, "sha256": hashlib.sha256(content).hexdigest()}
    changed(folder / "summary.json", tables=tables | {"frames": stated})
    assert "column variant holds 2,000 different words" in refused("report", folder)


@pytest.fixture
def fleet(tmp_path):
    return fleet_of(tmp_path / "week", 4)


@pytest.mark.parametrize(
    ("column", "value", "rows", "reason"),
    [
        ("name", "x" * 1_000_000, 1, "a text of 1,000,000 letters"),
        ("name", "x" * 11_000, 5_000, "its long texts have more than 500,000 letters"),
        ("evaluated", 1, 3_000_000, "rows and"),
        ("warnings", LINE * 5, 9_000, None),
    ],
)
def test_a_fleets_table_that_unpacks_to_too_much_is_refused(fleet, column, value, rows, reason):
    path = fleet / "drives.parquet"
    table = parquet.read_table(path).slice(0, 1)
    if rows > 10_000:
        table = table.select(["drive", column])
    many = table.take(pa.array(np.zeros(rows, np.int64)))
    place = many.schema.get_field_index(column)
    cells = pa.array([value], many.schema.field(place).type).take(pa.array([0] * rows))
    parquet.write_table(many.set_column(place, column, cells), path, compression="zstd")
    assert path.stat().st_size < 1 << 20
    if reason:
        assert reason in refused("report", fleet)
    else:
        from roadeval.results.tables import read_parquet

        assert len(read_parquet([path], "drives")) == rows
