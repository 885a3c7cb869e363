"""The page of fleets: its queries answer what they say, its manifests can be read."""

import re
from pathlib import Path

import duckdb
import pytest

import roadeval
from roadeval.fleet.drives import read_manifest
from tests.results.fleet.making import fleet_of

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "fleet.md"
TEXT = DOCUMENT.read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


(WEATHER,) = blocks("sql")


def final(fleet):
    return fleet.scores.query("variant == 'filtered' and final and region == 'all'")


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    """A folder with a fleet."""
    folder = tmp_path_factory.mktemp("fleets")
    fleet_of(folder / "monday", 30, frames=5)
    return folder


@pytest.fixture
def asked(fleets, monkeypatch):
    """Ask DuckDB, where the fleets are."""
    monkeypatch.chdir(fleets)
    with duckdb.connect() as database:
        yield lambda query: database.execute(query).df()


def test_err_by_weather_in_duckdb_and_in_pandas(asked, fleets):
    fleet = roadeval.Result(fleets / "monday")
    rows = final(fleet).merge(fleet.drives, on="drive")
    found = asked(WEATHER).set_index("weather")
    assert {*found.index} == {"sun", "rain", "fog"}
    names = {}
    exec(blocks("python")[-1], names)
    for weather, own in rows.groupby("tag_weather"):
        row = found.loc[weather]
        assert row.drives == len(own) == names["weather"].loc[weather, "count"]
        assert row.mean_ERR == pytest.approx(own.ERR.mean())
        assert row.mean_ERR == pytest.approx(names["weather"].loc[weather, "mean"])
        assert row.pooled_ERR == pytest.approx((own.FP + own.FN).sum() / own.N.sum())


def test_the_manifest_can_be_read(tmp_path):
    (toml,) = blocks("toml")
    for name in ("monday/a", "monday/b", "tuesday/street"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.mcap").touch()
    (tmp_path / "m.toml").write_text(toml)
    *monday, tuesday = read_manifest(tmp_path / "m.toml")
    assert [each.group for each in monday] == ["2026-11-16"] * 2
    assert (tuesday.group, tuesday.tags) == (None, {"weather": "sun"})
    assert tuesday.settings["labels"]["road"] == [3]
