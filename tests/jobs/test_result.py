"""Results of one drive and of many, opened as one."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import roadeval
from tests.jobs.making import settings, write_log


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A drive that was replayed by itself, and as a fleet of one."""
    folder = tmp_path_factory.mktemp("made")
    drive, config = write_log(folder / "small.mcap"), settings(jobs=1)
    alone = folder / "alone"
    roadeval.replay(drive, config, save=folder / "out.rrd", reports=alone)
    with ThreadPoolExecutor(1) as executor:
        many = roadeval.replay_fleet(drive, folder / "many", config, executor=executor).folder
    return SimpleNamespace(alone=alone, recording=folder / "out.rrd", many=many)


@pytest.mark.parametrize("table", ["drives", "scores", "effects"])
def test_a_drive_is_a_fleet_of_one(made, table):
    mine, fleets = (
        getattr(roadeval.Result(path), table).drop(columns="drive")
        for path in (made.alone, made.many)
    )
    assert len(mine) == len(fleets) > 0
    for column in mine.columns.intersection(fleets.columns):
        if table == "drives" and column not in ("in_log", "evaluated", "status", "width", "camera"):
            continue
        if pd.api.types.is_numeric_dtype(fleets[column]):
            own = mine[column].astype(float)
            np.testing.assert_array_equal(own, fleets[column].astype(float), err_msg=column)
        else:
            assert mine[column].tolist() == fleets[column].tolist()


def test_a_recording_and_the_folder_beside_it_hold_the_same(made):
    for table in ("scores", "effects", "frames"):
        one, other = (
            getattr(roadeval.Result(path), table) for path in (made.alone, made.recording)
        )
        pd.testing.assert_frame_equal(one, other)


def test_several_results_are_one_table_with_their_drives(made):
    both = roadeval.Result(made.alone, made.many)
    assert len({*both.scores["drive"]}) == len(both.compared) == len(both.drives) == 2
    one, other = both.frames.groupby("drive").ERR.mean()
    assert one == other
    assert roadeval.Result(made.recording).recording == made.recording
    assert roadeval.Result(made.recording, made.alone).recording is None
