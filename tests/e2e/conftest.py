"""Whole drives are replayed once; several tests look at each."""

import pytest

from tests.e2e.commands import DEMO, Replayed, replay


@pytest.fixture(scope="session")
def demo(tmp_path_factory) -> Replayed:
    """The synthetic drive that ships with the project."""
    return replay(tmp_path_factory.mktemp("demo"), DEMO)


@pytest.fixture(scope="session")
def street(data, tmp_path_factory) -> Replayed:
    """A street at 15 Hz whose truth is class ids: 3 is road, 11 is to be ignored."""
    drive = data / "drives" / "camvid_0016E5_15hz.mcap"
    labels = ("--road-label", 3, "--ignore-label", 11)
    return replay(tmp_path_factory.mktemp("street"), drive, *labels)


@pytest.fixture(scope="session")
def car_park(data, tmp_path_factory) -> Replayed:
    """Streets and a car park at 1 Hz whose truth is a mask that needs no explanation."""
    drive = data / "drives" / "camvid_0006R0_1hz.mcap"
    return replay(tmp_path_factory.mktemp("car_park"), drive)


@pytest.fixture(scope="session")
def unlabelled(data, tmp_path_factory) -> Replayed:
    """A city drive without truth."""
    drive = data / "drives" / "ford_shadows_unlabelled_raw.mcap"
    return replay(tmp_path_factory.mktemp("unlabelled"), drive)
