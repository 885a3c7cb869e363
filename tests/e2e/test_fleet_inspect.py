"""``roadeval inspect`` of a fleet: its worst frames, and one of them."""

import json
import shlex
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
    assert "(at most three per drive, a second apart)" in " ".join(read.split())
    assert max(map(len, read.splitlines())) <= 80
    assert "If a recording was not kept, --worst K says how to make it." in read


def test_of_a_drive_that_was_not_kept_the_command_that_makes_its_recording_is_said(
    fleet, drawn, tmp_path, monkeypatch
):
    first = worst(fleet)
    recording = fleet / "recordings" / f"{first.drive}.rrd"
    recording.unlink()
    done = drawn(fleet, "--worst", 1)
    assert done.returncode == 1
    command = done.stderr.partition("make it with: roadeval ")[2]
    monkeypatch.chdir(tmp_path)
    assert here(*shlex.split(command)).returncode == 0
    again = drawn(fleet, "--worst", 1)
    assert again.stdout.endswith(f"it.png: {first.drive}, frame {first.frame}\n")
    table = roadeval.Recording(recording).frames.query("variant == 'filtered' and stage == 'post'")
    assert table.set_index("frame").ERR[first.frame] == first.ERR


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--frame", 3], 2, "--frame does not go with a fleet"),
        (["--variant", "filtered"], 2, "--variant does not go with a fleet"),
        (["--worst", 99], 1, "there is no worst frame number 99: "),
    ],
)
def test_what_cannot_be_done_is_one_line(words, code, said, made):
    done = here("inspect", made / "f", *words)
    assert done.returncode == code
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
