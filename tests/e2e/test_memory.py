"""Memory does not grow with the length of the log."""

import os

import cv2
import numpy as np
import pytest

from roadeval.logs import LogWriter
from tests.e2e.commands import ROADEVAL


@pytest.fixture
def peak(tmp_path):
    """Replay a log of this many frames of 160x120; returns the peak memory in kB."""

    def peak(frames):
        drive = tmp_path / f"{frames}.mcap"
        noise = np.random.default_rng(0)
        with LogWriter(drive) as log:
            for number in range(frames):
                image = noise.integers(0, 256, (120, 160, 3), np.uint8)
                stamp = (number + 1) * 100_000_000
                log.image("/camera", stamp, cv2.imencode(".jpg", image)[1].tobytes(), "jpeg")
                log.mask(
                    "/road_mask",
                    stamp,
                    np.repeat(np.uint8([0, 255]), 60)[:, None].repeat(160, axis=1),
                )
        words = [
            "replay",
            drive,
            "--quiet",
            "--save",
            tmp_path / "out.rrd",
            "--reports",
            tmp_path / "reports",
        ]
        child = os.spawnv(os.P_NOWAIT, ROADEVAL, [str(word) for word in (ROADEVAL, *words)])
        _, status, used = os.wait4(child, 0)
        assert os.waitstatus_to_exitcode(status) == 0
        return used.ru_maxrss

    return peak


def test_a_log_ten_times_as_long_takes_the_same_memory(peak):
    assert peak(400) < 1.1 * peak(40)
