"""``roadeval inspect`` of a drive and of a fleet: the worst frames, and the viewer at one."""

import json
import shlex
import shutil
from pathlib import Path

import cv2
import pytest

from roadeval import Recording, Result, configure, replay_fleet
from roadeval.evaluation.tables import only
from roadeval.jobs.results import inspect as inspecting
from roadeval.jobs.results.result import DriveResult
from roadeval.recording import viewer
from tests.e2e.commands import here, roadeval
from tests.e2e.test_fleet import Here, write

DRIVER = Path("/usr/share/vulkan/icd.d")
drawable = pytest.mark.skipif(
    not list(DRIVER.glob("lvp_icd*.json")),
    reason="no driver that draws without a screen (Debian: mesa-vulkan-drivers)",
)


def worst(replayed):
    rows = [
        row
        for row in replayed.table("frames")
        if (row["variant"], row["stage"]) == ("filtered", "post") and row["ERR"]
    ]
    return int(max(rows, key=lambda row: float(row["ERR"]))["frame"])


@drawable
def test_the_viewer_is_drawn_without_a_screen_at_the_worst_frame(demo, tmp_path):
    picture = tmp_path / "worst.png"
    run = roadeval("inspect", demo.recording, "--worst", 1, "--screenshot", picture)
    assert run.returncode == 0, run.stderr
    assert run.stdout == f"{picture}: frame {worst(demo)}\n"
    drawn = cv2.imread(str(picture))
    assert drawn.shape == (1080, 1920, 3)
    assert drawn.std() > 20


@pytest.fixture
def told(monkeypatch, tmp_path):
    """Ask for a picture by a viewer that draws nothing; returns what is said of it."""
    monkeypatch.setattr(
        "roadeval.recording.viewer.screenshot", lambda recording, picture, frame: frame
    )

    def told(recording, *words):
        picture = tmp_path / "it.png"
        run = here("inspect", recording, "--screenshot", picture, *words)
        assert run.returncode == 0
        return run.stdout.removeprefix(f"{picture}: ")

    return told


def test_without_a_frame_the_worst_is_drawn_and_named(demo, told):
    said = f"frame {worst(demo)}, the worst with pictures (--frame N or --worst K takes another)\n"
    assert told(demo.recording) == said
    assert told(demo.recording, "--frame", "12") == "frame 12\n"


def test_the_window_opens_at_the_first_evaluated_frame_that_has_pictures(sparse, monkeypatch):
    shown = []
    monkeypatch.setattr("roadeval.recording.viewer.show", lambda path, frame: shown.append(frame))
    assert here("inspect", sparse.recording).returncode == 0
    opened = DriveResult(sparse.recording)
    assert opened.recording.layout.first_frame not in opened.pictured
    assert shown == [min(set(opened.pictured) & {int(r["frame"]) for r in sparse.table("frames")})]


@drawable
def test_the_viewer_shows_no_picture_on_a_frame_that_has_none(sparse, tmp_path):
    """Not even that of an earlier frame: the view of the camera, at the top left, is black."""
    drawn = {}
    for number in (14, 15):
        viewer.screenshot(sparse.recording, tmp_path / "it.png", number)
        drawn[number] = cv2.imread(str(tmp_path / "it.png"))[100:300, 50:300]
    assert drawn[14].std() > 20
    assert drawn[15].std() == 0


@pytest.mark.parametrize("words", [("--worst", "1"), ("--frame",)])
def test_a_frame_without_pictures_is_drawn_with_a_warning(words, sparse, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "roadeval.recording.viewer.screenshot", lambda recording, picture, frame: frame
    )
    bad = worst(sparse)
    words = words if len(words) == 2 else (*words, str(bad))
    picture = str(tmp_path / "it.png")
    run = here("inspect", sparse.recording, "--screenshot", picture, *words)
    assert (run.returncode, run.stdout) == (0, f"{picture}: frame {bad}\n")
    sentence = f"the recording has no pictures of frame {bad}, so the views of them are empty"
    assert run.stderr == f"roadeval: warning: {sentence}\n"


def test_where_nothing_was_scored_frames_are_ranked_by_doubt(unlabelled, told):
    opened = DriveResult(unlabelled.recording)
    rows = only(opened.table("unlabelled"), variant="filtered")
    first = int(rows["frame"][rows["disagreement"].argmax()])
    assert inspecting.worst(opened).frame == first
    other = inspecting.worst(DriveResult(unlabelled.recording, focus="unfiltered"))
    assert (other.variant, other.by) == ("unfiltered", "disagreement")
    again = "the first to look at with pictures (--frame N or --worst K takes another)"
    assert told(unlabelled.recording) == f"frame {first}, {again}\n"


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--frame", 123456], 1, "no frame 123456; the recording holds frames 0 to 99"),
        (["--worst", 500], 1, "there is no worst frame number 500: "),
        (["--worst", 1, "--variant", "net"], 1, "no variant net; there are filtered"),
    ],
)
def test_what_cannot_be_done_is_one_line(words, code, said, demo):
    run = here("inspect", demo.recording, *words)
    assert run.returncode == code
    assert said in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_without_a_screen_the_way_out_is_told(demo, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    run = here("inspect", demo.recording, "--frame", 12)
    assert run.returncode == 1
    assert "take a screenshot" in run.stderr


OPTIONS = {"training": {"frames": 4}}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A fleet of three drives, two of which are copies of one log; all recordings are kept."""
    home = tmp_path_factory.mktemp("inspected")
    write(home / "logs" / "one" / "a.mcap", 0)
    (home / "logs" / "two").mkdir()
    shutil.copy(home / "logs" / "one" / "a.mcap", home / "logs" / "two")
    write(home / "logs" / "two" / "c.mcap", 100)
    config = configure({**OPTIONS, "fleet": {"keep": "all"}})
    replay_fleet([home / "logs"], home / "f", config, executor=Here())
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


def worst_of_all(fleet):
    return Result(fleet).worst.iloc[0]


def test_the_list_is_of_all_drives_the_worst_first(made, fleet):
    first = worst_of_all(fleet)
    (fleet / "recordings" / f"{first.drive}.rrd").unlink()
    listed = json.loads(here("inspect", fleet, "--list", "--json").stdout)
    assert (listed[0]["drive"], listed[0]["frame"]) == (first.drive, first.frame)
    assert listed[0]["recording"] is None
    assert [each["rank"] for each in listed] == [*range(1, len(listed) + 1)]
    errors = [each["rates"]["ERR"] for each in listed]
    assert errors == sorted(errors, reverse=True)
    assert len({each["drive"] for each in listed}) == 3
    read = here("inspect", fleet, "--list").stdout
    assert "(at most 3 per drive, 3 seconds apart)" in " ".join(read.split())
    assert max(map(len, read.splitlines())) <= 80
    assert "If a recording was not kept, --worst K says how to make it." in read


def test_of_a_drive_that_was_not_kept_the_command_that_makes_its_recording_is_said(
    fleet, drawn, tmp_path, monkeypatch
):
    first = worst_of_all(fleet)
    recording = fleet / "recordings" / f"{first.drive}.rrd"
    recording.unlink()
    done = drawn(fleet, "--worst", 1)
    assert done.returncode == 1
    command = done.stderr.partition("make it with: roadeval ")[2]
    monkeypatch.chdir(tmp_path)
    assert here(*shlex.split(command)).returncode == 0
    again = drawn(fleet, "--worst", 1)
    assert again.stdout.endswith(f"it.png: {first.drive}, frame {first.frame}\n")
    table = Recording(recording).frames.query("variant == 'filtered' and stage == 'post'")
    assert table.set_index("frame").ERR[first.frame] == first.ERR


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--frame", 3], 2, "--frame does not go with a fleet"),
        (["--focus", "filterd"], 1, "no variant filterd; did you mean filtered? There are "),
        (["--worst", 99], 1, "there is no worst frame number 99: "),
    ],
)
def test_what_cannot_be_done_with_a_fleet_is_one_line(words, code, said, made):
    done = here("inspect", made / "f", *words)
    assert done.returncode == code
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
