"""A recording's identity: another for other results, the same for the same input."""

import shutil

import pytest

import roadeval
from roadeval.jobs.run import prepared
from roadeval.logs.log import open_log
from tests.jobs.making import settings, write_log


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("a") / "drive.mcap")


def of(path, **values):
    with open_log(path) as log:
        return prepared.identity(log, settings(**values))


def test_two_drives_of_one_name_differ(drive, tmp_path):
    other = write_log(tmp_path / "drive.mcap", broken=3)
    assert of(drive) != of(other)


@pytest.mark.parametrize(
    "values",
    [
        {"every": 2},
        {"record": "masks"},
        {"preset": "robust"},
        {"shadow": {"ring_width": 3}},
        {"variants": {"wide": {"preset": "paper"}}},
        {"train_frames": 5},
        {"truth": "/truth/road"},
    ],
)
def test_two_configurations_of_one_drive_differ(values, drive):
    assert of(drive) != of(drive, **values)


def test_two_models_differ_and_one_is_the_same_wherever_it_lies(drive, tmp_path):
    one, moved, other = tmp_path / "1.model", tmp_path / "2.model", tmp_path / "3.model"
    roadeval.train([drive], one, settings(train_frames=4))
    shutil.copy(one, moved)
    roadeval.train([drive], other, settings(train_frames=5))
    assert of(drive, model=one) == of(drive, model=moved) != of(drive, model=other)
    assert of(drive, model=one) != of(drive)


def test_two_versions_differ(drive, monkeypatch):
    before = of(drive)
    monkeypatch.setattr(prepared, "VERSION", "99.0")
    assert of(drive) != before


def test_where_a_log_lies_how_many_threads_and_where_results_land_make_no_difference(
    drive, tmp_path
):
    shutil.copy(drive, tmp_path / "drive.mcap")
    places = {"output": {"save": "x.rrd", "reports": "y", "mcap": "z.mcap"}}
    assert of(drive) == of(tmp_path / "drive.mcap", jobs=3, **places)
