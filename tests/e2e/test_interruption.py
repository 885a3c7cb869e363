"""A run that is stopped closes its recording and says where."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from roadeval import Recording
from tests.e2e.commands import DEMO, ROADEVAL
from tests.networks.making import without_end, written

BEGUN_S = 3
"""CPU time after which a program has loaded, and its network runs."""
ENOUGH = 1_000_000
"""Bytes of a recording that hold some frames, and far from all."""


def stop(folder, number):
    """Replay the demo drive until some frames are recorded, then send a signal."""
    words = ["replay", DEMO, "--save", folder / "out.rrd", "--reports", folder / "reports"]
    with subprocess.Popen([ROADEVAL, *words], stderr=subprocess.PIPE, text=True) as run:
        while sum(file.stat().st_size for file in folder.glob("*.rrd")) < ENOUGH:
            assert run.poll() is None, run.stderr.read()
            time.sleep(0.05)
        run.send_signal(number)
        said = run.stderr.read()
    return run.returncode, said


@pytest.fixture(
    scope="module", params=[(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["SIGINT", "SIGTERM"]
)
def stopped(request, tmp_path_factory):
    """A stopped run: its folder, its exit code and the one it should have, and what it said."""
    number, code = request.param
    folder = tmp_path_factory.mktemp("stopped")
    returned, said = stop(folder, number)
    return folder, (returned, code), said


def test_a_signal_leaves_a_readable_partial_recording_whose_name_is_told_and_nothing_else(stopped):
    folder, (returned, code), said = stopped
    assert returned == code
    assert "Traceback" not in said
    (path,) = re.findall(r"roadeval: interrupted: .*?(\S+\.rrd)", said)
    assert Path(path).parent == folder
    recording = Recording(Path(path))
    assert not recording.complete
    assert recording.layer("unfiltered", "post", 0).shape == (480, 640)
    assert not (folder / "out.rrd").exists()
    assert not list(folder.rglob("*.csv*"))
    assert not list(folder.rglob("summary.json"))
    assert not list(folder.rglob(".*"))


def seconds_of(process):
    """The CPU time of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_signal_ends_a_network_without_end(tmp_path):
    written(tmp_path / "n.onnx", [without_end("yes")], {"yes": True})
    (tmp_path / "n.toml").write_text('file = "n.onnx"\nseconds = 600\n')
    words = ["replay", DEMO, "--net", f"endless={tmp_path / 'n.toml'}", "--reports", tmp_path / "r"]
    with subprocess.Popen([ROADEVAL, *words], stderr=subprocess.DEVNULL) as run:
        while seconds_of(run.pid) < BEGUN_S:
            assert run.poll() is None
            time.sleep(0.05)
        run.send_signal(signal.SIGTERM)
        assert run.wait(20) == 143
