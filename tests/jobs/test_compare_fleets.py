"""Two fleets compared: from their folders."""

import json
import shutil

import numpy as np
import pytest

from roadeval.data.rows import Rows
from roadeval.errors import RoadevalError
from roadeval.evaluation import comparison
from roadeval.evaluation.comparison import Side
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.jobs import compare_fleets as job
from roadeval.jobs.compare_fleets import as_json, compare_fleets
from roadeval.results.fleet.folder import Fleet
from roadeval.results.fleet.kind import are_fleets
from roadeval.results.fleet.record import frames_path
from tests.results.fleet.making import RUN, fleet_of


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    """A fleet of eight scored drives among ten, and one whose every third drive is worse."""
    folder = tmp_path_factory.mktemp("fleets")
    return fleet_of(folder / "base", 10), fleet_of(folder / "new", 10, change=0.03)


@pytest.fixture(scope="module")
def compared(fleets):
    return compare_fleets(*fleets)


def test_the_drives_that_are_worse_are_found_and_no_others(compared):
    found = compared.comparison
    assert found.drives == 8
    changed = {found.names[row.drive] for row in found.changed(("filtered", "post"))}
    assert changed == {"drive_0000", "drive_0003", "drive_0006"}
    assert found.changed(("unfiltered", "post")) == []
    assert compared.content["warnings"] == [
        "2 drives of base are left out, for they are not scored in both: drive_0007, drive_0009"
    ]


def test_a_drives_numbers_are_those_of_the_comparison_of_its_two_results(fleets, compared):
    base, new = (Fleet(folder) for folder in fleets)
    drive = base.summary["drives"][3]["drive"]
    sides = [
        Side(label, "d", "x", _with_rates(f.frames(drive)))
        for label, f in (("base", base), ("new", new))
    ]
    alone = comparison.compare(sides, EvaluationSettings())
    (mask,) = (m for m in alone.changes if (m.variant, m.stage) == ("filtered", "post"))
    (row,) = (
        r for r in compared.comparison.drive_changes if r.drive == drive and r.variant == "filtered"
    )
    told = mask.difference["ERR"]
    assert (row.frames, row.base, row.new) == pytest.approx(
        (mask.frames, mask.base["ERR"], mask.new["ERR"])
    )
    assert (row.mean, row.low, row.high, row.p) == pytest.approx(
        (told.mean, told.low, told.high, told.p)
    )


def _with_rates(frames):
    from roadeval.evaluation import metrics
    from roadeval.evaluation.metrics import METRICS

    rates = metrics.table(frames[["TP", "TN", "FP", "FN"]].to_numpy())
    named = {name: np.array(frames[name].tolist()) for name in frames}
    return Rows(named | dict(zip(METRICS, rates.T, strict=True)))


def test_drives_that_have_moved_are_known_by_their_logs(fleets, tmp_path):
    base, new = fleets
    moved = shutil.copytree(new, tmp_path / "moved")
    for path in moved.rglob("*-0000000*"):
        if path.exists():
            path.rename(path.with_name(path.name.replace("-0", "-f")))
    content = json.loads((moved / "fleet.json").read_text().replace("-0000000", "-f000000"))
    (moved / "fleet.json").write_text(json.dumps(content))
    _rename_drives(moved / "drives.parquet")
    found = compare_fleets(base, moved).comparison
    assert (found.drives, found.by_log) == (8, 8)


def _rename_drives(path):
    import pyarrow as pa
    from pyarrow import parquet

    table = parquet.ParquetFile(path).read()
    names = [name.replace("-0", "-f") for name in table["drive"].to_pylist()]
    place = table.column_names.index("drive")
    parquet.write_table(table.set_column(place, "drive", pa.array(names)), path)


def test_conditions_are_judged_over_drives(fleets):
    held = compare_fleets(*fleets, fail_if=["post.filtered.ERR > +0.5pp"]).held
    (why,) = held
    assert "over 8 drives" in why
    assert compare_fleets(*fleets, fail_if=["post.filtered.ERR > 20%"]).held == []


def test_settings_that_differ_are_told(fleets, tmp_path):
    run = RUN | {"frames": {"scale": 1.0, "every": 2}}
    other = fleet_of(tmp_path / "other", 3, run=run)
    (warning,) = (w for w in compare_fleets(fleets[0], other).content["warnings"] if "every" in w)
    assert "`frames.every` 1 and 2" in warning


def test_with_many_drives_only_the_first_variants_are_tested_and_it_is_said(fleets, monkeypatch):
    monkeypatch.setattr(job, "TESTS", 8)
    found = compare_fleets(*fleets)
    assert found.comparison.untested == (("unfiltered", "post"),)
    assert {row.variant for row in found.comparison.drive_changes} == {"filtered"}
    assert any("not tested for post.unfiltered" in w for w in found.content["warnings"])


def test_only_chosen_variants_are_compared(fleets):
    found = compare_fleets(*fleets, variants=["unfiltered"]).comparison
    assert {change.variant for change in found.changes} == {"unfiltered"}
    with pytest.raises(RoadevalError, match="no variant net; there are filtered"):
        compare_fleets(*fleets, variants=["net"])


def test_equal_fleets_give_equal_json_without_nan(fleets):
    first, second = (as_json(compare_fleets(fleets[0], fleets[0])) for _ in range(2))
    assert first == second
    content = json.loads(first, parse_constant=pytest.fail)
    assert {row["mean"] for row in content["drive_changes"]} == {0}


def test_fleets_of_other_drives_are_an_error(fleets, tmp_path):
    other = fleet_of(tmp_path / "other", 0)
    with pytest.raises(RoadevalError, match="nothing can be compared"):
        compare_fleets(fleets[0], other)


def test_a_drive_whose_frames_have_gone_is_named(fleets, tmp_path):
    cut = shutil.copytree(fleets[1], tmp_path / "cut")
    drive = Fleet(cut).summary["drives"][0]["drive"]
    path = frames_path(cut, drive)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RoadevalError, match=r"frames\.parquet: damaged"):
        compare_fleets(fleets[0], cut)
    path.unlink()
    with pytest.raises(RoadevalError, match=r"frames\.parquet: is not there"):
        compare_fleets(fleets[0], cut)


def test_a_fleet_and_a_single_result_are_not_compared(fleets, tmp_path):
    assert are_fleets(fleets)
    assert not are_fleets([tmp_path])
    with pytest.raises(RoadevalError, match=r"is a fleet and .* is not"):
        are_fleets([fleets[0], tmp_path])
    with pytest.raises(RoadevalError, match="two fleets can be compared, not 1"):
        are_fleets(fleets[:1])
