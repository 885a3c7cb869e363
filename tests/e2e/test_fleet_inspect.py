"""``roadeval inspect`` of a fleet: its worst frames, one of them, and all its recordings."""

import json
import shutil
from importlib.util import find_spec

import pytest

import roadeval
from roadeval.cli.app import main
from roadeval.recording.screen import viewer
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here, write

catalogued = pytest.mark.skipif(find_spec("datafusion") is None, reason="no DataFusion")
OPTIONS = {"training": {"frames": 4}}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A fleet of three drives, two of which are copies of one log; all recordings are kept."""
    home = tmp_path_factory.mktemp("inspected")
    write(home / "logs" / "one" / "a.mcap", 0)
    (home / "logs" / "two").mkdir()
    shutil.copy(home / "logs" / "one" / "a.mcap", home / "logs" / "two")
    write(home / "logs" / "two" / "c.mcap", 100)
    config = roadeval.configure({**OPTIONS, "fleet": {"keep": "all"}})
    roadeval.replay_fleet([home / "logs"], home / "f", config, executor=Here())
    return home


@pytest.fixture
def fleet(made, tmp_path):
    """The same, to be changed."""
    shutil.copytree(made / "f", tmp_path / "f")
    return tmp_path / "f"


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Ask for a picture by a viewer that draws nothing."""
    monkeypatch.setattr(viewer, "screenshot", lambda recording, picture, frame: frame)
    picture = tmp_path / "it.png"
    return lambda *words: here("inspect", *words, "--screenshot", picture)


def worst(fleet):
    return roadeval.Fleet(fleet).worst.iloc[0]


def test_the_list_is_of_all_drives_the_worst_first(made, fleet):
    first = worst(fleet)
    (fleet / "recordings" / f"{first.drive}.rrd").unlink()
    listed = json.loads(here("inspect", fleet, "--list", "--json").stdout)
    assert (listed[0]["drive"], listed[0]["frame"]) == (first.drive, first.frame)
    assert listed[0]["recording"] is None
    assert [each["rank"] for each in listed] == [*range(1, len(listed) + 1)]
    errors = [each["rates"]["ERR"] for each in listed]
    assert errors == sorted(errors, reverse=True)
    assert len({each["drive"] for each in listed}) == 3
    read = here("inspect", fleet, "--list").stdout
    assert max(map(len, read.splitlines())) <= 80
    assert "Where no recording was kept, --worst K replays the drive first." in read


def test_a_drive_that_was_not_kept_is_replayed_and_its_results_stay(fleet, drawn):
    first = worst(fleet)
    recording = fleet / "recordings" / f"{first.drive}.rrd"
    before = {path: path.stat().st_mtime_ns for path in fleet.rglob("*") if path.is_file()}
    recording.unlink()
    done = drawn(fleet, "--worst", 1)
    assert done.returncode == 0, done.stderr
    assert f"note: {first.drive}: no recording was kept, so it is replayed from " in done.stderr
    assert done.stdout.endswith(f"it.png: {first.drive}, frame {first.frame}\n")
    after = {path: path.stat().st_mtime_ns for path in fleet.rglob("*") if path.is_file()}
    assert {path for path in before if before[path] != after.get(path)} == {recording}
    assert after.keys() == before.keys()
    again = drawn(fleet, "--worst", 1)
    assert "replayed" not in again.stderr
    table = roadeval.Recording(recording).frames.query("variant == 'filtered' and stage == 'post'")
    assert table.set_index("frame").ERR[first.frame] == first.ERR


def test_a_log_that_has_changed_is_warned_of(tmp_path, drawn):
    log = write(tmp_path / "logs" / "a.mcap", 0)
    config = roadeval.configure(OPTIONS)
    roadeval.replay_fleet([log], tmp_path / "f", config, executor=Here())
    write(log, 7)
    assert (
        "a.mcap: has changed since the fleet was run" in drawn(tmp_path / "f", "--worst", 1).stderr
    )


def test_a_log_that_has_gone_is_one_line(tmp_path, drawn):
    log = write(tmp_path / "logs" / "a.mcap", 0)
    config = roadeval.configure(OPTIONS)
    roadeval.replay_fleet([log], tmp_path / "f", config, executor=Here())
    log.unlink()
    done = drawn(tmp_path / "f", "--worst", 1)
    assert done.returncode == 1
    assert f"{log}: has gone, and no recording of it was kept" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--frame", 3], 2, "--frame of a fleet needs its drive: --drive ID"),
        (["--worst", 1, "--drive", "a"], 2, "--worst counts over all drives"),
        (["--variant", "filtered"], 2, "--variant does not go with a fleet"),
        (["--drive", "c"], 1, "no drive c; by that name there is c-"),
        (["--worst", 99], 1, "only the worst "),
    ],
)
def test_what_cannot_be_done_is_one_line(words, code, said, made):
    done = here("inspect", made / "f", *words)
    assert done.returncode == code
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_without_recordings_the_catalogue_says_how_to_keep_some(fleet, capsys):
    shutil.rmtree(fleet / "recordings")
    assert main(["inspect", str(fleet)]) == 1
    said = capsys.readouterr().err
    assert "no recording was kept; run the fleet's command again with --keep all or worst:N" in said
    assert said.count("\n") == 1


def test_without_datafusion_the_extra_is_named(made, monkeypatch, capsys):
    monkeypatch.setattr("roadeval.recording.screen.catalogue.find_spec", lambda name: None)
    assert main(["inspect", str(made / "f")]) == 1
    assert "pip install 'rerun-sdk[catalog]'" in capsys.readouterr().err


@catalogued
def test_the_catalogue_holds_every_drive_with_its_err_and_tells_of_copies(made, monkeypatch):
    from rerun.catalog import CatalogClient

    monkeypatch.setattr(viewer, "has_screen", lambda: False)
    seen = {}

    def look():
        address, _, number = seen["address"].partition("/entry/")
        (dataset,) = (e for e in CatalogClient(address).datasets() if str(e.id) == number)
        seen["rows"] = dataset.segment_table().to_pandas()
        seen["blueprints"] = dataset.default_blueprint(), dataset.default_segment_table_blueprint()

    def emit(text):
        seen["address"] = text.rpartition(" ")[2]

    monkeypatch.setattr("roadeval.cli.console.emit", emit)
    monkeypatch.setattr("roadeval.jobs.fleet_inspect.wait", look)
    done = here("inspect", made / "f")
    assert done.returncode == 0, done.stderr
    assert seen["address"].startswith("rerun+http://127.0.0.1:")
    drives = roadeval.Fleet(made / "f").drives
    first, second = sorted(d for d in drives.drive if d.startswith("a-"))
    told = [line for line in done.stderr.splitlines() if "left out" in line]
    assert len(told) == 1
    assert first in told[0]
    assert second in told[0]
    rows = {row["property:fleet:drive"][0]: row for _, row in seen["rows"].iterrows()}
    assert len(rows) == 2
    final = roadeval.Fleet(made / "f").scores.query(
        "variant == 'filtered' and final and region == 'all'"
    )
    errors = final.set_index("drive").ERR
    for drive, row in rows.items():
        assert row["property:fleet:ERR"][0] == errors[drive]
    assert all(seen["blueprints"])


def test_a_fleet_from_elsewhere_loads_no_code(fleet, drawn):
    first = worst(fleet)
    (fleet / "recordings" / f"{first.drive}.rrd").unlink()
    run = fleet / "results" / first.drive / "run.toml"
    run.write_text(f'{run.read_text()}\n[variants.theirs]\nchain = ["antigravity:fly", "post"]\n')
    done = drawn(fleet, "--worst", 1)
    assert done.returncode == 1
    assert "run.toml: its chain names code, antigravity:fly, which is loaded only" in done.stderr
    assert done.stderr.count("\n") == 1
