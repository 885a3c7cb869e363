"""The recording as a file: complete under its name, partial where a run ended early."""

import errno
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import rerun as rr

from roadeval.recording.layout import RecordingError, RecordRule
from roadeval.recording.recorder import LEAST_FREE, Recorder
from roadeval.recording.recording import Recording
from tests.recording.making import layout, rerun, result
from tests.results.making import lines


def test_a_recording_without_its_results_does_not_take_its_name(drive, tmp_path):
    with Recorder(tmp_path / "out.rrd", layout()) as recorder:
        recorder.write(recorder.encode(drive[0], 0), lines(drive[0]))
    assert [path.name for path in tmp_path.iterdir()] == [recorder.partial.name]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_a_partial_recording_with_every_frame_so_far(stop, drive, tmp_path):
    recorder = Recorder(tmp_path / "out.rrd", layout())
    with pytest.raises(stop):
        _record_and_stop(recorder, drive[:5], stop)
    partial = Recording(recorder.partial)
    assert not partial.complete
    assert partial.frame_numbers == (0, 1, 2, 3, 4)
    assert list(partial.frames.frame) == [2, 3, 4]
    assert partial.summary == {}
    assert not recorder.path.exists()
    assert rerun("verify", recorder.partial) == 0


def test_recordings_of_one_process_leave_the_threads_of_their_blueprints_alone(drive, tmp_path):
    """Rerun 0.41 keeps two for each closed stream until `init`, for each blueprint for ever."""
    process, threads = psutil.Process(), []
    for _ in range(9):
        with Recorder(tmp_path / "out.rrd", layout()) as recorder:
            recorder.write(recorder.encode(drive[0], 0), lines(drive[0]))
        threads.append(process.num_threads())
    assert threads[-1] <= threads[0] + 2 * 8 + 2


def _record_and_stop(recorder, results, stop):
    with recorder:
        for each in results:
            recorder.write(recorder.encode(each, 0), lines(each))
        raise stop


KILLED = """
    import os, pathlib, signal, sys
    from roadeval.recording.recorder import Recorder
    from tests.recording.making import layout, result
    from tests.results.making import lines
    with Recorder(pathlib.Path(sys.argv[1]), layout()) as recorder:
        for number in range(int(sys.argv[2])):
            recorder.write(recorder.encode(result(number), 0), lines(result(number)))
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(("frames", "images", "numbers"), [(20, 16, 0), (100, 94, 64)])
def test_a_killed_run_leaves_all_but_the_frames_that_wait(frames, images, numbers, tmp_path):
    written = [sys.executable, "-c", textwrap.dedent(KILLED), tmp_path / "out.rrd", str(frames)]
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run(written, cwd=root, check=False).returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    assert re.fullmatch(r"out\.[0-9a-f]{8}\.partial\.rrd", left.name)
    partial = Recording(left)
    assert not partial.complete
    assert partial.frame_numbers == tuple(range(images))
    assert partial.unsure == tuple(range(images))
    assert list(partial.frames.frame) == list(range(images))
    assert len(partial.scalars("/metrics/filtered/post/ERR")) == numbers
    last = images - 1
    assert partial.is_whole(last, scored=True)
    assert not partial.is_whole(images, scored=False)
    back = partial.layer("filtered", "post", last)
    np.testing.assert_array_equal(back, next(result(last).variants[0].masks())[1].pixels())


def test_a_disk_that_is_full_from_the_start_is_told_at_once(tmp_path, monkeypatch):
    leave_free(monkeypatch, 1 << 20)
    for path in (tmp_path / "out.rrd", tmp_path / "new" / "er" / "out.rrd"):
        with pytest.raises(RecordingError, match="the disk is full"), _recorder(path):
            pass
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_disk_that_fills_up_is_told_while_the_partial_recording_can_still_be_closed(
    drive, tmp_path, monkeypatch
):
    given = []

    def write_until_it_is_full(recorder):
        with recorder:
            for each in drive:
                leave_free(monkeypatch, (1 << 30) if each.frame.number < 10 else (1 << 20))
                given.append(each.frame.number)
                recorder.write(recorder.encode(each, 0), lines(each))

    recorder = _recorder(tmp_path / "out.rrd")
    with pytest.raises(RecordingError, match="the disk is full"):
        write_until_it_is_full(recorder)
    assert rerun("verify", recorder.partial) == 0
    assert Recording(recorder.partial).frame_numbers == tuple(given)
    assert 10 < len(given) < len(drive)


def test_what_waits_has_its_room_on_the_disk_beside_the_least(drive, tmp_path, monkeypatch):
    with _recorder(tmp_path / "out.rrd") as recorder:
        leave_free(monkeypatch, LEAST_FREE + 1)
        recorder.check_disk_space()
        recorder.write(recorder.encode(drive[3], 0), lines(drive[3]))
        with pytest.raises(RecordingError, match="the disk is full"):
            recorder.check_disk_space()


@pytest.mark.parametrize(("rule", "shown"), [("all", 1000), ("every:4", 250), ("worst:50", 50)])
def test_the_size_of_a_recording_is_foretold_and_held_against_the_free_space(
    tmp_path, monkeypatch, rule, shown
):
    for free, said in ((10**12, ""), (10**8, ", and only 100 MB are free: `output.record` masks")):
        with Recorder(tmp_path / "out.rrd", layout(), RecordRule.parse(rule)) as recorder:
            leave_free(monkeypatch, free)
            first = recorder.encode(result(0), 0)
            assert recorder.forecast(first._replace(payloads={}), 1000) == ""
            large = first._replace(payloads={"/camera": bytes(5_000_000)})
            expected = f"the recording will take about {5 * shown} MB{said}"
            assert recorder.forecast(large, 1000).startswith(expected)
            assert recorder.forecast(large, 1000) == ""
            leave_free(monkeypatch, 10**12)


def leave_free(monkeypatch, size):
    monkeypatch.setattr(
        "shutil.disk_usage", lambda folder: SimpleNamespace(total=1 << 40, free=size)
    )


TOO_LARGE = """
import resource, signal, sys
from pathlib import Path
from roadeval.recording.layout import RecordingError
from roadeval.recording import recorder
from tests.recording.making import record, some_frames

recorder.LOOK_S = 0.2
recorder.Recorder.check_disk_space = lambda self: None
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    record(Path(sys.argv[1]), some_frames())
except RecordingError as error:
    print(error)
    print(error.__cause__.strerror)
"""


def recorded_with_too_little_room(path, limit):
    """Record in a process of its own, for a limit on the size of files holds for all of it."""
    command = [sys.executable, "-c", TOO_LARGE, str(path), str(limit)]
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        command, cwd=root, check=False, capture_output=True, text=True, timeout=60
    )
    assert "cannot be written any further: File too large" in done.stdout, done.stderr
    # To free the stream would wait for Rerun's writer, and print this.
    assert "previous sink" not in done.stderr
    assert not path.exists()
    assert len(list(path.parent.iterdir())) < 2
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_file_that_may_not_grow_ends_the_run_and_does_not_get_its_name(
    recording, tmp_path, share
):
    limit = int(recording.path.stat().st_size * share)
    assert recorded_with_too_little_room(tmp_path / "out.rrd", limit) == os.strerror(errno.EFBIG)


@pytest.mark.parametrize("hung", ["save", "flush", "disconnect"])
def test_no_wait_for_a_hung_disk_is_without_end(drive, tmp_path, monkeypatch, hung):
    monkeypatch.setattr("roadeval.recording.recorder.PATIENCE_S", 0.4)
    monkeypatch.setattr("roadeval.recording.recorder.LOOK_S", 0.1)
    monkeypatch.setattr(rr.RecordingStream, hung, lambda *_, **__: time.sleep(60))
    begun = time.monotonic()
    with (
        pytest.raises(RecordingError, match="written any further: Input/output error"),
        _recorder(tmp_path / "out.rrd") as recorder,
    ):
        recorder.write(recorder.encode(drive[3], 0), lines(drive[3]))
    assert time.monotonic() - begun < 10


def test_a_place_that_cannot_be_written_is_told_at_once(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be written"), _recorder(tmp_path / "file/out"):
        pass
    with pytest.raises(RecordingError, match="is a folder"), _recorder(tmp_path):
        pass
    long = tmp_path / f"{300 * 'a'}.rrd"
    with pytest.raises(RecordingError, match="File name too long"), _recorder(long):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def _recorder(path):
    return Recorder(path, layout())
