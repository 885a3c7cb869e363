"""A run that is stopped closes its recording and tells where it is."""

import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from roadeval import Recording
from tests.e2e.commands import DEMO, ROADEVAL

ENOUGH = 1_000_000
"""Bytes of a recording that hold some frames, and far from all."""


def stopped(folder, number):
    """Replay the demo drive until some frames are recorded, then send a signal."""
    words = ["replay", DEMO, "--save", folder / "out.rrd", "--reports", folder / "reports"]
    with subprocess.Popen([ROADEVAL, *words], stderr=subprocess.PIPE, text=True) as run:
        while sum(file.stat().st_size for file in folder.glob("*.rrd")) < ENOUGH:
            assert run.poll() is None, run.stderr.read()
            time.sleep(0.05)
        run.send_signal(number)
        said = run.stderr.read()
    return run.returncode, said


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_leaves_a_readable_partial_recording_whose_name_is_told(number, code, tmp_path):
    returned, said = stopped(tmp_path, number)
    assert returned == code
    assert "Traceback" not in said
    (path,) = re.findall(r"roadeval: interrupted: .*?(\S+\.rrd)", said)
    assert Path(path).parent == tmp_path
    recording = Recording(Path(path))
    assert not recording.complete
    assert recording.layer("unfiltered", "post", 0).shape == (480, 640)


def test_a_signal_leaves_no_output_under_its_final_name(tmp_path):
    stopped(tmp_path, signal.SIGINT)
    assert not (tmp_path / "out.rrd").exists()
    assert not list(tmp_path.rglob("*.csv*"))
    assert not list(tmp_path.rglob("summary.json"))
