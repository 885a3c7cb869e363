"""The recording as a file: complete or partial, in few chunks, with images that a rule keeps."""

import errno
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import rerun as rr

from roadeval import Recording
from roadeval.data import Doubt
from roadeval.recording import recorder as recorder_module
from roadeval.recording.layout import RecordingError, RecordRule
from roadeval.recording.recorder import LEAST_FREE, Recorder, worst_error
from roadeval.recording.rows import (
    CHUNK_BYTES,
    IMAGES_AND_TEXT,
    NUMBERS,
    SHARE,
    Batcher,
    numbers,
    states,
    texts,
)
from tests.recording.making import RESULTS, layout, rerun, result
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


@pytest.mark.parametrize(
    "share",
    [
        0.001,
        0.3,
        0.99,
        *(pytest.param(share, marks=pytest.mark.sweep) for share in (0.02, 0.6, 0.9)),
    ],
)
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


def test_a_call_of_rerun_that_fails_says_why(tmp_path, monkeypatch):
    def refuse(*_args, **_options):
        raise ValueError("no such\nview")

    monkeypatch.setattr(rr.RecordingStream, "save", refuse)
    with (
        pytest.raises(RecordingError, match="written any further: no such view"),
        _recorder(tmp_path / "out.rrd"),
    ):
        pass


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


WAIT = (8, 64)


def rows_of(pending):
    return pending.chunk().to_record_batch().column("frame").to_pylist()


def run(frames, rows, limits=WAIT):
    """Feed frames, each a row of ``rows(frame)`` by path; yield what is due, and after which."""
    batcher = Batcher(limits)
    for frame in range(frames):
        for path, columns, value in rows(frame):
            batcher[path, columns].add((frame, frame, frame), value)
        for key in batcher.end_frame():
            yield frame, key[0], rows_of(batcher[key])
            del batcher[key]
    for key in batcher:
        yield frames, key[0], rows_of(batcher[key])


def test_every_row_comes_once_and_in_order_and_waits_no_longer_than_it_may():
    ended = list(run(1000, lambda frame: [("/a", numbers, (frame,))]))
    assert [row for *_, rows in ended for row in rows] == list(range(1000))
    for after, _, rows in ended[:-1]:
        assert after - rows[0] + 1 == min(max((after + 1) // SHARE, 8), 64)


def test_an_entity_is_full_by_its_bytes_and_others_wait_on():
    half = "x" * (CHUNK_BYTES // 2)
    ended = list(run(8, lambda _: [("/large", texts, half), ("/small", texts, "x")]))
    assert [rows for _, path, rows in ended if path == "/large"] == [[0, 1], [2, 3], [4, 5], [6, 7]]
    assert [rows for _, path, rows in ended if path == "/small"] == [list(range(8))]


@pytest.mark.parametrize(("limits", "most"), [(IMAGES_AND_TEXT, 320), (NUMBERS, 70)])
def test_an_hour_of_small_rows_makes_few_chunks(limits, most):
    ended = list(run(36_000, lambda _: [("/a", states, "on")], limits))
    assert sum(len(rows) for *_, rows in ended) == 36_000
    assert len(ended) < most


ERRORS = [0.1, 0.5, 0.3, 0.5, 0.2, 0.4, 0.0]


def selective(path, rule):
    return Recorder(path, layout(), RecordRule.parse(rule))


def write(recorder):
    for number, err in enumerate(ERRORS):
        each = result(number, err=err)
        recorder.write(recorder.encode(each, number), lines(each))


def keep(path, rule):
    """Record frames of these ERR by a rule."""
    with selective(path, rule) as recorder:
        write(recorder)
        recorder.finish(RESULTS)
    return Recording(path)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("rule", "frames"),
    [("worst:1", [1]), ("worst:2", [1, 3]), ("worst:4", [1, 2, 3, 5]), ("worst:99", range(7))],
)
def test_the_worst_frames_pictures_are_kept_and_of_equals_the_earlier(rule, frames, tmp_path):
    recording = keep(tmp_path / "out.rrd", rule)
    assert list(recording.frame_numbers) == list(frames)
    assert list(recording.frames.frame) == list(range(7))
    for number in frames:
        mask = next(result(number).variants[0].masks())[1].pixels()
        np.testing.assert_array_equal(recording.layer("filtered", "post", number), mask)


def test_without_truth_the_most_doubtful_frames_are_kept(tmp_path):
    rule, without = RecordRule.parse("worst:2"), replace(layout(), has_truth=False)
    with Recorder(tmp_path / "out.rrd", without, rule) as recorder:
        for number, entropy in enumerate([0.1, 0.4, 0.2, 0.3]):
            doubts = (Doubt("filtered", "post", entropy), Doubt("unfiltered", "post", 1 - entropy))
            each = replace(result(number), tallies=(), errors={}, doubts=doubts)
            each = replace(each, frame=replace(each.frame, truth=None))
            recorder.write(recorder.encode(each, number))
        recorder.finish(RESULTS)
    assert list(Recording(recorder.path).frame_numbers) == [1, 3]


def test_frames_are_ranked_by_the_error_of_the_focus():
    (other,) = result(0, err=0.9).tallies
    (focus,) = result(0, err=0.1).tallies
    both = replace(result(0), tallies=(other, replace(focus, variant="mine")))
    assert worst_error(both, replace(layout(), focus="mine")) == 0.1
    assert worst_error(result(0), replace(layout(), focus="mine")) == -1


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, ValueError])
def test_a_run_that_is_stopped_keeps_the_worst_so_far(stop, tmp_path):
    def stopped(recorder):
        with recorder:
            write(recorder)
            raise stop

    recorder = selective(tmp_path / "out.rrd", "worst:3")
    with pytest.raises(stop):
        stopped(recorder)
    assert names(tmp_path) == [recorder.partial.name]
    partial = Recording(recorder.partial)
    assert not partial.complete
    assert partial.frame_numbers == (1, 3, 5)


def test_no_more_is_held_than_there_is_room_for_and_the_run_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "HELD", 3 << 20)
    with selective(tmp_path / "out.rrd", "worst:40") as recorder:
        plain = recorder.encode(result(0), 0)
        for number, err in enumerate([0.1, 0.5, 0.3, 0.5, 0.2, 0.4]):
            payloads = {"/camera": b"0" * (1 << 20)}
            each = plain._replace(when=(number,) * 3, payloads=payloads, error=err)
            said = recorder.forecast(each, 6)
            assert said.endswith("worst:40 keeps those that fit in 3 MiB of memory, about 3") or (
                number and not said
            )
            recorder.write(each)
        recorder.finish(RESULTS)
    assert Recording(recorder.path).frame_numbers == (1, 3, 5)
