"""A run or a fleet that is killed, or whose disk is full, at any of its steps on files."""

import os
import shutil
from functools import partial
from pathlib import Path

import pytest

import roadeval
from tests.e2e.test_fleet import Here, tables, write
from tests.faults import making, steps
from tests.faults.forking import Forks

pytestmark = pytest.mark.skipif(
    not hasattr(os, "fork"), reason="a run of its own is a forked process"
)


IN_PLACE = "in place"
SITUATIONS = ["again", IN_PLACE, "first"]
SOME = [pytest.param(3, id="some"), pytest.param(1, id="all", marks=pytest.mark.sweep)]
"""From a step at which a run is killed to the next one."""


@pytest.fixture(scope="module")
def forks():
    with Forks() as forks:
        yield forks


@pytest.fixture(params=SITUATIONS)
def situation(request):
    return request.param


@pytest.fixture
def whole(tmp_path_factory):
    """What a run of this name writes."""

    def whole(name):
        place = tmp_path_factory.mktemp("whole")
        making.run(place, name)
        return making.outputs(place)

    return whole


@pytest.fixture
def again(tmp_path, situation):
    """Returns a place with earlier outputs, each time as new."""
    model = tmp_path / "model"
    model.mkdir()
    if situation != "first":
        making.run(model, "old")
    if situation == IN_PLACE:
        (model / "reports" / "sub").mkdir()
        for name in ("notes.txt", "sub/notes.txt"):
            (model / "reports" / name).write_text("mine")

    def again() -> Path:
        shutil.rmtree(tmp_path / "place", ignore_errors=True)
        return shutil.copytree(model, tmp_path / "place", symlinks=True)

    return again


def notes(place):
    """Others' files under their names."""
    paths = [path.relative_to(place) for path in place.rglob("notes.txt")]
    return {path: (place / path).read_text() for path in paths if path.parts[0][0] != "."}


def check_next_run(place, before, whole):
    """The next run writes its own outputs, and leaves nothing of the one that was killed."""
    making.run(place, "next")
    assert making.outputs(place) == whole
    assert notes(place) == notes(before)
    hidden = [path for path in place.rglob("*") if path.name.startswith(".")]
    assert hidden == []
    assert {path.name for path in place.iterdir()} == set(making.PLACES)


@pytest.mark.parametrize("stride", SOME)
def test_a_run_that_is_killed_at_any_step_leaves_old_or_new_and_nothing_else(
    forks, again, whole, tmp_path, stride
):
    old, new, after = making.outputs(again()), whole("new"), whole("next")
    moving, code, number = 0, steps.KILLED, 1 - stride
    while code == steps.KILLED:
        number += stride
        place = again()
        code = forks.run(partial(making.run, place, "new"), steps.KilledAt(number))
        found = making.outputs(place)
        for name in ("out.rrd", "out.mcap"):
            assert found[name] in (old[name], new[name])
        if found["reports"] not in (old["reports"], new["reports"]):
            assert "summary.json" not in found["reports"]
            moving += 1
            making.recover(place)
            assert making.outputs(place)["reports"] == new["reports"]
        assert notes(place) == notes(tmp_path / "model")
        check_next_run(place, tmp_path / "model", after)
    assert code == steps.DONE
    assert number > 20
    assert moving


def test_a_disk_that_is_full_from_any_step_on_costs_no_earlier_result(
    forks, again, whole, situation, tmp_path
):
    old, new, after = making.outputs(again()), whole("new"), whole("next")
    code, number = steps.FAILED, 0
    while code == steps.FAILED:
        number += 1
        place = again()
        code = forks.run(partial(making.run, place, "new"), steps.FullFrom(number))
        found = making.outputs(place)
        if found["reports"] not in (old["reports"], new["reports"]):
            assert "summary.json" not in found["reports"]
            making.recover(place)
            assert making.outputs(place)["reports"] == new["reports"]
        elif code == steps.FAILED and found["reports"] == old["reports"]:
            # They take their names together, the folder first.
            assert (found["out.rrd"], found["out.mcap"]) == (old["out.rrd"], old["out.mcap"])
        assert notes(place) == notes(tmp_path / "model")
        check_next_run(place, tmp_path / "model", after)
    assert code == steps.DONE
    assert number > 10


@pytest.mark.parametrize("situation", [IN_PLACE], indirect=True)
@pytest.mark.parametrize("size", [0, 3, 40, 400])
def test_no_room_for_a_file_s_content_costs_no_earlier_result(forks, again, whole, size, tmp_path):
    old, after = making.outputs(again()), whole("next")
    place = again()
    limited = partial(steps.in_small_files, size, partial(making.run, place, "new"))
    assert forks.run(limited, steps.undisturbed) == steps.FAILED
    assert making.outputs(place) == old
    assert notes(place) == notes(tmp_path / "model")
    check_next_run(place, tmp_path / "model", after)


def run(logs: Path, folder: Path) -> None:
    """Replay a fleet in this process, each drive with the model of the other one's fold."""
    config = {
        "only": ["unfiltered"],
        "chain": ["similarity", "post"],  # which learns as the SVM does, in a tenth of its time
        "training": {"frames": 3, "pixels_per_class": 20},
        "frames": {"max_frames": 4},
        "fleet": {"folds": 2},
    }
    roadeval.replay_fleet(logs, folder, roadeval.configure(config), executor=Here())


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize(
    "stride", [pytest.param(97, id="some"), pytest.param(13, id="more", marks=pytest.mark.sweep)]
)
def test_the_resumed_result_is_that_of_one_go(tmp_path, stride):
    logs = tmp_path / "logs"
    for number, name in enumerate("ab"):
        write(logs / f"{name}.mcap", 100 * number)
    run(logs, tmp_path / "whole")
    want = files(tmp_path / "whole"), tables(tmp_path / "whole")
    number, code = 1, steps.KILLED
    with Forks("pandas", "scipy.stats", "roadeval.jobs.run.fleet") as forks:
        while code == steps.KILLED:
            folder = tmp_path / str(number)
            code = forks.run(partial(run, logs, folder), steps.KilledAt(number))
            again = forks.run(partial(run, logs, folder), steps.undisturbed)
            assert again == steps.DONE
            assert (files(folder), tables(folder)) == want, number
            number += stride
    assert code == steps.DONE
    assert number > 100
