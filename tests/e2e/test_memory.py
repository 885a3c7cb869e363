"""Memory does not grow with the length of the log."""

import os

import cv2
import numpy as np

from roadeval.logs import LogWriter
from tests.e2e.commands import ROADEVAL

PERIOD_NS = 100_000_000
ROAD = np.repeat(np.uint8([0, 255]), 60)[:, None].repeat(160, axis=1)


def write(drive, frames):
    """Write a log of this many noisy frames, the lower half of which is road."""
    noise = np.random.default_rng(0)
    with LogWriter(drive) as log:
        for stamp in range(PERIOD_NS, (frames + 1) * PERIOD_NS, PERIOD_NS):
            image = noise.integers(0, 256, (*ROAD.shape, 3), np.uint8)
            log.image("/camera", stamp, cv2.imencode(".jpg", image)[1].tobytes(), "jpeg")
            log.mask("/road_mask", stamp, ROAD)


def peak_memory(folder, frames):
    """Replay such a log; returns the peak memory of the process in kB."""
    drive = folder / f"{frames}.mcap"
    write(drive, frames)
    outputs = "--save", folder / "out.rrd", "--reports", folder / "reports"
    words = [str(word) for word in (ROADEVAL, "replay", drive, "--quiet", *outputs)]
    _, status, used = os.wait4(os.spawnv(os.P_NOWAIT, ROADEVAL, words), 0)
    assert os.waitstatus_to_exitcode(status) == 0
    return used.ru_maxrss


def test_a_log_ten_times_as_long_takes_the_same_memory(tmp_path):
    assert peak_memory(tmp_path, 400) < 1.1 * peak_memory(tmp_path, 40)
