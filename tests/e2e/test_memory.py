"""Memory does not grow with the length of the log."""

import json
import subprocess
import sys

import numpy as np

from tests.fixtures.logged import jpeg, write_drive
from tests.measuring import PEAK

PERIOD_NS = 100_000_000
ROAD = np.repeat(np.uint8([0, 255]), 60)[:, None].repeat(160, axis=1)
MEASURE = f"""
{PEAK}
import json, os, sys
from roadeval import replay
from roadeval.recording import recorder

# Rows wait in memory for more frames the longer the recording, up to a limit at 1,024 frames and
# more. Here that limit is reached before the first measurement.
recorder.IMAGES_AND_TEXT = recorder.NUMBERS = (20, 20)

peaks = {{}}

def look(progress):
    if progress.stage == "replaying":
        peaks[progress.done] = peak()
        if progress.done == 300:  # what is drawn after the last frame takes time
            print(json.dumps(peaks), flush=True)
            os._exit(0)

replay(sys.argv[1], save="out.rrd", reports="reports", on_progress=look)
"""


def write(drive, frames):
    """Write a log of this many noisy frames, the lower half of which is road."""
    noise = np.random.default_rng(0)
    images = (jpeg(noise.integers(0, 256, (*ROAD.shape, 3), np.uint8)) for _ in range(frames))
    messages = ({"/camera": image, "/road_mask": ROAD} for image in images)
    write_drive(drive, (((n + 1) * PERIOD_NS, each) for n, each in enumerate(messages)))


def test_a_log_three_times_as_long_takes_the_same_memory(tmp_path):
    """Peak of the process at frame 100, after five times the rows that wait, and at frame 300."""
    write(tmp_path / "drive.mcap", 300)
    command = [sys.executable, "-c", MEASURE, "drive.mcap"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    peaks = json.loads(run.stdout)
    assert peaks["100"] > 100_000, "a process with these libraries is not so small"
    assert peaks["300"] < 1.05 * peaks["100"]
