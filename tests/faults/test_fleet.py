"""A fleet whose command is killed at any of its steps on the file system, and given again."""

import os
from functools import partial
from pathlib import Path

import pytest

import roadeval
from tests.e2e.test_fleet import Here, tables, write
from tests.faults import steps
from tests.faults.forking import Forks

pytestmark = pytest.mark.skipif(
    not hasattr(os, "fork"), reason="a run of its own is a forked process"
)


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


def test_the_resumed_result_is_that_of_one_go(tmp_path):
    logs = tmp_path / "logs"
    for number, name in enumerate("ab"):
        write(logs / f"{name}.mcap", 100 * number)
    run(logs, tmp_path / "whole")
    want = files(tmp_path / "whole"), tables(tmp_path / "whole")
    number, code = 1, steps.KILLED
    with Forks() as forks:
        while code == steps.KILLED:
            folder = tmp_path / str(number)
            code = forks.run(partial(run, logs, folder), steps.KilledAt(number))
            again = forks.run(partial(run, logs, folder), steps.undisturbed)
            assert again == steps.DONE
            assert (files(folder), tables(folder)) == want, number
            number += 41
    assert code == steps.DONE
    assert number > 100
