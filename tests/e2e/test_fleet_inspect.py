"""``roadeval inspect`` of a fleet: its worst frames, and one of them."""

import json
import shutil

import pytest

import roadeval
from roadeval.recording import viewer
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here, write

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
    return roadeval.Result(fleet).worst.iloc[0]


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
    assert "Where no recording was kept, --worst K --trust-sources replays" in read


def test_by_default_the_worst_frame_of_all_opens(made, monkeypatch):
    shown = []
    monkeypatch.setattr(viewer, "show", lambda recording, frame: shown.append((recording, frame)))
    assert here("inspect", made / "f").returncode == 0
    first = worst(made / "f")
    assert shown == [(made / "f" / "recordings" / f"{first.drive}.rrd", first.frame)]


def test_a_drive_that_was_not_kept_is_replayed_and_its_results_stay(fleet, drawn):
    first = worst(fleet)
    recording = fleet / "recordings" / f"{first.drive}.rrd"
    before = {path: path.stat().st_mtime_ns for path in fleet.rglob("*") if path.is_file()}
    recording.unlink()
    done = drawn(fleet, "--worst", 1, "--trust-sources")
    assert done.returncode == 0, done.stderr
    assert f"note: {first.drive}: no recording was kept, so it is replayed from " in done.stderr
    assert done.stdout.endswith(f"it.png: {first.drive}, frame {first.frame}\n")
    after = {path: path.stat().st_mtime_ns for path in fleet.rglob("*") if path.is_file()}
    assert {path for path in before if before[path] != after.get(path)} == {recording}
    assert after.keys() == before.keys()
    again = drawn(fleet, "--worst", 1, "--trust-sources")
    assert "replayed" not in again.stderr
    table = roadeval.Recording(recording).frames.query("variant == 'filtered' and stage == 'post'")
    assert table.set_index("frame").ERR[first.frame] == first.ERR


def test_a_log_that_has_changed_is_warned_of(tmp_path, drawn):
    log = write(tmp_path / "logs" / "a.mcap", 0)
    config = roadeval.configure(OPTIONS)
    roadeval.replay_fleet([log], tmp_path / "f", config, executor=Here())
    write(log, 7)
    assert (
        "a.mcap: has changed since the fleet was run"
        in drawn(tmp_path / "f", "--worst", 1, "--trust-sources").stderr
    )


def test_a_log_that_has_gone_is_one_line(tmp_path, drawn):
    log = write(tmp_path / "logs" / "a.mcap", 0)
    config = roadeval.configure(OPTIONS)
    roadeval.replay_fleet([log], tmp_path / "f", config, executor=Here())
    log.unlink()
    done = drawn(tmp_path / "f", "--worst", 1, "--trust-sources")
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


def test_a_fleet_from_elsewhere_loads_no_code(fleet, drawn):
    first = worst(fleet)
    (fleet / "recordings" / f"{first.drive}.rrd").unlink()
    run = fleet / "results" / first.drive / "run.toml"
    run.write_text(f'{run.read_text()}\n[variants.theirs]\nchain = ["antigravity:fly", "post"]\n')
    done = drawn(fleet, "--worst", 1, "--trust-sources")
    assert done.returncode == 1
    assert "run.toml: its chain names code, antigravity:fly, which is loaded only" in done.stderr
    assert done.stderr.count("\n") == 1
