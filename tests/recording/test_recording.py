"""What was recorded is read back: from complete recordings and from partial ones."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import weakref
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pyarrow as pa
import pytest
import rerun as rr

from roadeval.data import ERRORS, TRUTH, Health, Pictures, Role
from roadeval.recording import NullRecorder, Recorder, Recording, RecordingError
from roadeval.recording.codecs import LabelCodec, codec
from roadeval.recording.layout import SHADOW_TRUTH
from roadeval.recording.read.recording import _around
from roadeval.recording.write.recorder import LEAST_FREE, UNWRITTEN
from roadeval.recording.write.tracks import CHUNK_BYTES, Track
from tests.recording.making import HEIGHT, WIDTH, frame, layout, result, rows_of, unscored

SUMMARY = {"verdict": "It helps.", "totals": {}, "seconds": {"filtered": {"post": 0.5}}}
RESULTS = {"summary": json.dumps(SUMMARY), "windows": "window,ERR\n0,0.25\n"}
RERUN = Path(sys.executable).with_name("rerun")


def record(path, results, known=None, texts=None):
    """Write a complete recording of these frames."""
    with Recorder(path, known or layout()) as recorder:
        for each in results:
            recorder.write(recorder.encode(each))
        recorder.finish(RESULTS if texts is None else texts)
    return Recording(path)


def rerun(*words):
    """Run Rerun's own tool; its exit code."""
    quiet = {**os.environ, "CI": "1"}
    words = [RERUN, "rrd", *map(str, words)]
    return subprocess.run(words, env=quiet, capture_output=True, check=False).returncode


@pytest.fixture(scope="module")
def drive():
    """Two training frames, 17 evaluated ones with a note on one."""
    return some_frames()


def some_frames():
    frames = [*map(unscored, range(2)), *map(result, range(2, 19))]
    frames[5] = replace(frames[5], notes=("It rains.", "It pours."))
    return frames


@pytest.fixture(scope="module")
def recording(drive, tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "out.rrd", drive)


# --- Images -----------------------------------------------------------------------------------


def test_masks_and_labels_of_every_frame_come_back_equal(drive, recording):
    for each in drive:
        for layer in each.variants[0].layers():
            if layer.spec.name != "ndi":
                back = recording.layer("filtered", layer.spec.name, each.frame.number)
                np.testing.assert_array_equal(back, layer.array)


def test_ndi_comes_back_to_its_code(drive, recording):
    codes = next(drive[3].variants[0].layers()).array
    np.testing.assert_allclose(recording.layer("filtered", "ndi", 3), codes / 127.5 - 1, atol=1e-6)


def test_truth_and_error_map_come_back_equal(drive, recording):
    np.testing.assert_array_equal(recording.truth(4), drive[4].frame.truth)
    errors = recording.layer("filtered", "errors", 4)
    np.testing.assert_array_equal(errors, drive[4].errors["filtered"].array)


def test_the_cameras_own_file_is_passed_on(tmp_path):
    shown = frame(0)
    jpeg = cv2.imencode(".jpg", shown.image, [cv2.IMWRITE_JPEG_QUALITY, 30])[1].tobytes()
    logged = replace(shown, payload=memoryview(jpeg), media_type="image/jpeg")
    back = record(tmp_path / "out.rrd", [replace(unscored(0), frame=logged)]).image(0)
    decoded = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(back, decoded)


def test_a_raw_image_is_recorded_in_its_own_size(recording):
    assert recording.image(0).shape == (HEIGHT, WIDTH, 3)


def test_a_layer_that_a_frame_lacks_is_not_shown_from_the_frame_before(drive, tmp_path):
    bare = replace(drive[3], variants=(), errors={})
    recording = record(tmp_path / "out.rrd", [drive[2], bare, drive[4]])
    with pytest.raises(RecordingError, match="/filtered/post has nothing on frame 3"):
        recording.layer("filtered", "post", 3)
    assert rows_of(recording, "/filtered/post", "EncodedImage:blob") == {2: 1, 3: 0, 4: 1}


def test_frames_without_pictures_end_what_is_shown_and_are_not_among_those_that_have_some(
    drive, tmp_path
):
    pictured = [4, 5, 11]
    sparse = [
        each if each.frame.number in pictured else replace(each, pictures=Pictures.NONE)
        for each in drive
    ]
    recording = record(tmp_path / "out.rrd", sparse)
    assert recording.frame_numbers == tuple(pictured)
    assert list(recording.roles) == pictured
    np.testing.assert_array_equal(recording.truth(11), drive[11].frame.truth)
    with pytest.raises(RecordingError, match="/truth has nothing on frame 6"):
        recording.truth(6)
    for path, component in (
        ("/camera", "EncodedImage:blob"),
        ("/filtered/ndi", "EncodedDepthImage:blob"),
        ("/filtered/rings", "SegmentationImage:buffer"),
    ):
        assert rows_of(recording, path, component) == {4: 1, 5: 1, 6: 0, 11: 1, 12: 0}


@pytest.mark.parametrize("read_ahead", [8 << 20, 0])
def test_every_frame_comes_back_in_any_order(drive, recording, read_ahead, monkeypatch):
    monkeypatch.setattr("roadeval.recording.read.recording.READ_AHEAD", read_ahead)
    again = Recording(recording.path)
    for each in (*drive[9:], *reversed(drive)):
        np.testing.assert_array_equal(again.truth(each.frame.number), each.frame.truth)


def test_an_entity_is_gone_through_once_whatever_frames_are_read(drive, recording, monkeypatch):
    again, passes = Recording(recording.path), []
    batches = again._batches
    monkeypatch.setattr(
        again, "_batches", lambda *given, **words: passes.append(given) or batches(*given, **words)
    )
    for each in (drive[-1], *drive):
        again.layer("filtered", "post", each.frame.number)
    with pytest.raises(RecordingError, match="nothing on frame 99"):
        again.layer("filtered", "post", 99)
    assert len(passes) == 1


def pages_of(sizes):
    """Pages of one frame each, of these many bytes, and the most of them that lived at once."""
    made, most = [], [0]

    def pages():
        for number, size in enumerate(sizes):
            blobs = pa.array([[0] * size], pa.list_(pa.uint8()))
            made.append(weakref.ref(blobs))
            most[0] = max(most[0], sum(each() is not None for each in made))
            yield [number], blobs
            del blobs

    return pages(), most


def test_no_more_of_an_entity_is_held_than_is_read_ahead(monkeypatch):
    monkeypatch.setattr("roadeval.recording.read.recording.READ_AHEAD", 500)
    pages, most = pages_of([100] * 60)
    there, payloads = _around(30, pages)
    assert len(there) == 60
    assert 30 in payloads
    assert most[0] <= 7


@pytest.mark.parametrize(
    ("frame", "sizes", "kept"),
    [
        (2, [10] * 9, [2, 3, 4, 5]),
        (8, [10] * 9, [5, 6, 7, 8]),
        (7, [10] * 9, [5, 6, 7, 8]),
        (1, [10, 99, 10, 10], [1]),
        (3, [10, 10, 99, 10], [3]),
        (99, [10] * 3, [0, 1, 2]),
    ],
)
def test_the_frames_after_one_are_kept_first_then_the_nearest_before(
    frame, sizes, kept, monkeypatch
):
    one = pa.array([[0] * 10], pa.list_(pa.uint8())).nbytes
    monkeypatch.setattr("roadeval.recording.read.recording.READ_AHEAD", 4 * one)
    assert list(_around(frame, pages_of(sizes)[0])[1]) == kept


def test_rows_that_were_put_together_with_others_may_have_no_list_at_all(recording, monkeypatch):
    batch = pa.RecordBatch.from_pydict(
        {"frame": [1, 2, 3, 4], "Scalars:scalars": pa.array([[0.5], None, [], [0.25]])}
    )
    chunk = SimpleNamespace(to_record_batch=lambda: batch)
    stream = SimpleNamespace(filter=lambda **given: [chunk])
    again = Recording(recording.path)
    monkeypatch.setattr(again, "_stream", lambda: stream)
    assert again.scalars("/metrics/filtered/post/ERR").to_dict() == {1: 0.5, 4: 0.25}
    batch = batch.slice(0, 2)
    assert again.scalars("/metrics/filtered/post/ERR").to_dict() == {1: 0.5}


# --- Numbers and words ------------------------------------------------------------------------


def test_the_tables_lines_come_back_as_a_table(recording):
    assert list(recording.frames.frame) == list(range(2, 19))
    assert list(recording.frames.columns) == ["frame", "variant", "stage", "ERR"]


def test_a_drive_without_rows_gives_an_empty_table_with_its_columns(tmp_path):
    frames = record(tmp_path / "out.rrd", [unscored(0)]).frames
    assert frames.empty
    assert "ERR" in frames.columns


def test_results_come_back(recording):
    assert recording.complete
    assert recording.summary == SUMMARY
    assert recording.windows.ERR.tolist() == [0.25]


def test_rates_facts_and_milliseconds_are_series(recording):
    assert recording.scalars("/metrics/filtered/post/ERR").tolist() == [0.25] * 17
    assert recording.scalars("/timing/filtered/shadow").tolist() == [4.0] * 19
    assert recording.scalars("/facts/filtered/shadow/components")[18] == 3.0


def test_counts_are_five_numbers_a_frame(recording):
    (batch,) = recording._batches("/counts/filtered/post", "Scalars:scalars", static=False)
    assert batch.column("Scalars:scalars").to_pylist() == [[1, 2, 3, 4, 10]] * 17


def test_an_undefined_rate_leaves_a_gap(tmp_path):
    frames = [result(0, fnr=0.5), result(1, fnr=float("nan")), result(2, fnr=0.75)]
    series = record(tmp_path / "out.rrd", frames).scalars("/metrics/filtered/post/FNR")
    assert series.to_dict() == {0: 0.5, 2: 0.75}


def test_notes_belong_to_their_frame(recording):
    assert recording.notes(5) == ("It rains.", "It pours.")
    assert recording.notes(6) == ()


def test_roles_are_known_for_every_frame(recording):
    assert recording.frame_numbers == tuple(range(19))
    assert recording.roles[1] == Role.TRAINING
    assert recording.roles[18] == Role.EVALUATED


def test_a_lane_holds_changes_only_and_ends_where_nothing_is_known(tmp_path):
    states = [Health.OK, Health.OK, Health.FAILED, None, Health.OK]
    frames = [
        result(number, health={"filtered": state} if state else {})
        for number, state in enumerate(states)
    ]
    recording = record(tmp_path / "out.rrd", frames)
    lane = dict(recording._rows("/state/filtered", "StateChange:state"))
    assert lane == {0: "ok", 2: "failed", 3: "", 4: "ok"}


# --- Files ------------------------------------------------------------------------------------


def test_nothing_stands_under_the_final_name_before_the_end(drive, tmp_path):
    with Recorder(tmp_path / "new" / "out.rrd", layout()) as recorder:
        recorder.write(recorder.encode(drive[0]))
        assert not recorder.path.exists()
        assert recorder.partial.parent == recorder.path.parent
        recorder.finish(RESULTS)
        assert recorder.path.exists()
    assert not recorder.partial.exists()


def test_reruns_own_tool_finds_no_fault(recording):
    assert rerun("verify", recording.path) == 0


def test_the_same_input_gives_the_same_recording_but_for_the_timing(drive, tmp_path):
    slower = [
        replace(each, variants=tuple(_slower(variant) for variant in each.variants))
        for each in drive
    ]
    hours = {**RESULTS, "summary": json.dumps({**SUMMARY, "seconds": {"filtered": {"post": 9}}})}
    record(tmp_path / "a.rrd", drive)
    record(tmp_path / "b.rrd", slower, texts=hours)
    assert rerun("compare", "--unordered", tmp_path / "a.rrd", tmp_path / "b.rrd") != 0
    timing = ["/timing/filtered/shadow", "/timing/filtered/post", "/timing/summary"]
    drops = [word for path in timing for word in ("--drop-entity", path)]
    for name in ("a", "b"):
        words = [*drops, tmp_path / f"{name}.rrd", "-o", tmp_path / f"{name}.same.rrd"]
        assert rerun("filter", *words) == 0
    same = [tmp_path / "a.same.rrd", tmp_path / "b.same.rrd"]
    assert rerun("compare", "--unordered", *same) == 0


def test_when_the_run_took_place_is_not_recorded(recording):
    assert not list(recording._batches("/__properties", "RecordingInfo:start_time", static=True))
    assert list(recording._batches("/__properties", "RecordingInfo:name", static=True))


def _slower(variant):
    stages = tuple(replace(stage, seconds=stage.seconds * 3) for stage in variant.stages)
    return replace(variant, stages=stages)


def test_settled_frames_wait_no_more(drive, tmp_path):
    with Recorder(tmp_path / "out.rrd", layout()) as recorder:
        for each in drive[:5]:
            recorder.write(recorder.encode(each))
        recorder.settle()
        partial = Recording(recorder.partial)
        assert partial.frame_numbers == (0, 1, 2, 3, 4)
        assert list(partial.frames.frame) == [2, 3, 4]
        recorder.finish(RESULTS)
    assert Recording(recorder.path).frame_numbers == (0, 1, 2, 3, 4)


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


def _record_and_stop(recorder, results, stop):
    with recorder:
        for each in results:
            recorder.write(recorder.encode(each))
        raise stop


@pytest.mark.parametrize("at", [1, 5])
def test_who_stops_a_run_while_a_chunk_is_made_loses_no_frame_of_it(
    at, drive, tmp_path, monkeypatch
):
    calls, usual = [], Track.chunk

    def interrupted(track):
        calls.append(track)
        if len(calls) == at:
            raise KeyboardInterrupt
        return usual(track)

    monkeypatch.setattr(Track, "chunk", interrupted)
    recorder = _recorder(tmp_path / "out.rrd")
    with pytest.raises(KeyboardInterrupt):
        _record_and_stop(recorder, drive, SystemExit)
    partial = Recording(recorder.partial)
    assert partial.frame_numbers == tuple(range(8))
    for path in ("/camera", "/truth", "/filtered/post"):
        assert rows_of(partial, path, "EncodedImage:blob") == dict.fromkeys(range(8), 1)
    assert list(partial.frames.frame) == [2, 3, 4, 5, 6, 7]


KILLED = """
    import os, pathlib, signal, sys
    from roadeval.recording import Recorder
    from tests.recording.making import layout, result
    with Recorder(pathlib.Path(sys.argv[1]), layout()) as recorder:
        for number in range(int(sys.argv[2])):
            recorder.write(recorder.encode(result(number)))
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(("frames", "images", "numbers"), [(20, 16, 0), (100, 94, 64)])
def test_a_killed_run_leaves_all_but_the_frames_that_wait(frames, images, numbers, tmp_path):
    written = [sys.executable, "-c", textwrap.dedent(KILLED), tmp_path / "out.rrd", str(frames)]
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run(written, cwd=root, check=False).returncode == -signal.SIGKILL
    partial = Recording(tmp_path / "out.partial.rrd")
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


def test_of_a_complete_recording_no_frame_is_unsure(recording):
    assert recording.unsure == ()


def test_a_disk_that_is_full_from_the_start_is_told_at_once(tmp_path, monkeypatch):
    leave_free(monkeypatch, 1 << 20)
    for path in (tmp_path / "out.rrd", tmp_path / "new" / "er" / "out.rrd"):
        with pytest.raises(RecordingError, match="the disk is full"), _recorder(path):
            pass
    assert not list(tmp_path.iterdir())


def test_a_disk_that_fills_up_is_told_while_the_partial_recording_can_still_be_closed(
    drive, tmp_path, monkeypatch
):
    given = []

    def write_until_it_is_full(recorder):
        with recorder:
            for each in drive:
                leave_free(monkeypatch, (1 << 30) if each.frame.number < 10 else (1 << 20))
                given.append(each.frame.number)
                recorder.write(recorder.encode(each))

    recorder = _recorder(tmp_path / "out.rrd")
    with pytest.raises(RecordingError, match="the disk is full"):
        write_until_it_is_full(recorder)
    assert rerun("verify", recorder.partial) == 0
    assert Recording(recorder.partial).frame_numbers == tuple(given)
    assert 10 < len(given) < len(drive)


def test_what_waits_has_its_room_on_the_disk_beside_the_least(drive, tmp_path, monkeypatch):
    with _recorder(tmp_path / "out.rrd") as recorder:
        leave_free(monkeypatch, LEAST_FREE + 1)
        recorder.check_room()
        recorder.write(recorder.encode(drive[3]))
        with pytest.raises(RecordingError, match="the disk is full"):
            recorder.check_room()


def test_few_bytes_ever_wait_for_reruns_own_thread(tmp_path, monkeypatch):
    sent = []
    flush = Recorder._flush

    def counted(recorder):
        sent.append(recorder._unwritten)
        flush(recorder)

    monkeypatch.setattr(Recorder, "_flush", counted)
    with _recorder(tmp_path / "out.rrd") as recorder:
        first = recorder.encode(result(0))
        large = replace(first, payloads=dict.fromkeys(first.payloads, bytes(CHUNK_BYTES - 1)))
        for number in range(2):
            recorder.write(replace(large, number=number))
    assert len(first.payloads) > 4
    assert max(sent) < UNWRITTEN + 2 * CHUNK_BYTES


def leave_free(monkeypatch, size):
    monkeypatch.setattr(
        "shutil.disk_usage", lambda folder: SimpleNamespace(total=1 << 40, free=size)
    )


TOO_LARGE = """
import resource, signal, sys
from pathlib import Path
from roadeval.recording import RecordingError
from tests.recording.test_recording import record, some_frames

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    record(Path(sys.argv[1]), some_frames())
except RecordingError as error:
    print(error)
"""


def test_a_file_whose_index_could_not_be_written_does_not_get_its_name(recording, tmp_path):
    # In a process of its own, for the limit on the size of files holds for all of it.
    limit = recording.path.stat().st_size * 9 // 10
    command = [sys.executable, "-c", TOO_LARGE, str(tmp_path / "out.rrd"), str(limit)]
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        command, cwd=root, check=False, capture_output=True, text=True, timeout=60
    )
    assert "is the disk full" in done.stdout, done.stderr
    assert not (tmp_path / "out.rrd").exists()


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


def test_no_recording_is_made_by_the_recorder_that_does_nothing(drive):
    with NullRecorder() as recorder:
        recorder.write(recorder.encode(drive[0], 0))
        recorder.settle()
        recorder.finish(RESULTS)


# --- Versions ---------------------------------------------------------------------------------


def recorded_in(version, folder, monkeypatch):
    """A recording whose arrangement is said to be of this version."""
    with monkeypatch.context() as patched:
        patched.setattr("roadeval.recording.layout.FORMAT", version)
        record(folder / "out.rrd", [unscored(0)])
    return folder / "out.rrd"


def test_the_arrangement_of_a_recording_has_a_version(recording, tmp_path, monkeypatch):
    assert recording.format == 3
    earlier = Recording(recorded_in(1, tmp_path, monkeypatch))
    assert (earlier.format, earlier.frame_numbers) == (1, (0,))


def test_truths_and_errors_of_the_second_version_were_labels(drive, tmp_path, monkeypatch):
    def codec_then(spec, width, height):
        labels = spec in (TRUTH, SHADOW_TRUTH, ERRORS)
        return LabelCodec(spec, width, height) if labels else codec(spec, width, height)

    with monkeypatch.context() as patched:
        patched.setattr("roadeval.recording.layout.FORMAT", 2)
        patched.setattr("roadeval.recording.write.encoding.codec", codec_then)
        shadow = drive[3].frame.truth
        shown = replace(drive[3], frame=replace(drive[3].frame, shadow_truth=shadow))
        record(tmp_path / "out.rrd", [*drive[:3], shown], layout(has_shadow_truth=True))
    earlier = Recording(tmp_path / "out.rrd")
    np.testing.assert_array_equal(earlier._array("/true_shadow", 3), shadow)
    assert rows_of(earlier, "/truth", "SegmentationImage:buffer") == dict.fromkeys(range(4), 1)
    np.testing.assert_array_equal(earlier.truth(3), drive[3].frame.truth)
    errors = earlier.layer("filtered", "errors", 3)
    np.testing.assert_array_equal(errors, drive[3].errors["filtered"].array)
    np.testing.assert_array_equal(
        earlier.layer("filtered", "post", 3), next(drive[3].variants[0].masks())[1].pixels()
    )


def test_a_recording_that_tells_no_version_is_of_the_first(recording, tmp_path):
    words = ["--drop-entity", "/__properties/roadeval", recording.path, "-o", tmp_path / "out.rrd"]
    assert rerun("filter", *words) == 0
    first = Recording(tmp_path / "out.rrd")
    assert (first.format, len(first.frame_numbers)) == (1, 19)


def test_a_recording_of_a_later_version_is_one_line(tmp_path, monkeypatch):
    path = recorded_in(4, tmp_path, monkeypatch)
    with pytest.raises(RecordingError) as caught:
        Recording(path)
    assert str(caught.value) == f"{path}: made by a later version of roadeval: update it"


# --- What cannot be read ----------------------------------------------------------------------


def test_an_unknown_layer_is_answered_with_those_that_exist(recording):
    with pytest.raises(RecordingError, match=r"no /filtered/depth; there are .*/filtered/ndi"):
        recording.layer("filtered", "depth", 3)


def test_an_unknown_frame_is_told(recording):
    with pytest.raises(RecordingError, match="nothing on frame 99"):
        recording.image(99)


@pytest.mark.parametrize("content", [b"", b"RR", b"\x89MCAP0\r\n", b"frame,stamp_ns\n"])
def test_a_file_that_is_no_recording_is_told(content, tmp_path):
    (tmp_path / "x.rrd").write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.rrd: not a recording"):
        Recording(tmp_path / "x.rrd")


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(RecordingError, match="no such recording"):
        Recording(tmp_path / "x.rrd")


def test_a_recording_by_another_program_is_told(tmp_path):
    other = rr.RecordingStream("someone_else")
    other.save(tmp_path / "x.rrd")
    other.log("words", rr.TextDocument("hello"))
    other.flush()
    other.disconnect()
    with pytest.raises(RecordingError, match="by someone_else, not by roadeval"):
        Recording(tmp_path / "x.rrd")


def test_a_torn_file_is_told_with_the_way_to_mend_it(recording, tmp_path):
    whole = recording.path.read_bytes()
    # In the middle of a picture: cut between two chunks, a file has nothing torn in it.
    (tmp_path / "torn.rrd").write_bytes(whole[: whole.rindex(b"\x89PNG") + 30])
    with pytest.raises(RecordingError, match="rerun rrd optimize --continue-on-error"):
        Recording(tmp_path / "torn.rrd")
