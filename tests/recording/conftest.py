"""A drive, and its recording."""

import pytest

from tests.recording.making import record, some_frames


@pytest.fixture(scope="package")
def drive():
    """Two training frames, 17 evaluated ones with two notes on one."""
    return some_frames()


@pytest.fixture(scope="package")
def recording(drive, tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "out.rrd", drive)
