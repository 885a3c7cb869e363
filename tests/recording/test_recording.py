"""What was recorded is read back: images, numbers and texts."""

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rerun as rr

from roadeval.data import RESERVED
from roadeval.recording.layout import Layout, RecordingError, RecordRule
from roadeval.recording.recorder import Recorder
from roadeval.recording.recording import Recording
from tests.recording.making import (
    RESULTS,
    VARIANT,
    frame,
    layout,
    paths_of,
    record,
    rows_of,
    unscored,
)
from tests.results.making import lines


def test_the_cameras_own_file_is_passed_on(tmp_path):
    shown = frame(0)
    jpeg = cv2.imencode(".jpg", shown.image, [cv2.IMWRITE_JPEG_QUALITY, 30])[1].tobytes()
    logged = replace(shown, payload=memoryview(jpeg), media_type="image/jpeg")
    back = record(tmp_path / "out.rrd", [replace(unscored(0), frame=logged)]).image(0)
    decoded = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(back, decoded)


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
    with Recorder(tmp_path / "out.rrd", layout(), RecordRule.parse("every:2")) as recorder:
        for each in drive:
            position = 0 if each.frame.number in pictured else 1
            recorder.write(recorder.encode(each, position), lines(each))
        recorder.finish(RESULTS)
    recording = Recording(recorder.path)
    assert recording.frame_numbers == tuple(pictured)
    np.testing.assert_array_equal(recording.truth(11), drive[11].frame.truth)
    with pytest.raises(RecordingError, match="/truth has nothing on frame 6"):
        recording.truth(6)
    for path, component in (
        ("/camera", "EncodedImage:blob"),
        ("/filtered/ndi", "EncodedDepthImage:blob"),
        ("/filtered/rings", "SegmentationImage:buffer"),
    ):
        assert rows_of(recording, path, component) == {4: 1, 5: 1, 6: 0, 11: 1, 12: 0}


@pytest.mark.parametrize(
    ("version", "told"),
    [
        (2, "made by roadeval 0.1.9, whose format is no longer read: replay the log again"),
        (4, "made by roadeval 0.1.9, a later version: update roadeval"),
    ],
)
def test_a_recording_of_another_format_is_one_line(version, told, tmp_path, monkeypatch):
    path = tmp_path / "out.rrd"
    monkeypatch.setattr("roadeval.recording.layout.FORMAT", version)
    record(path, [unscored(0)], layout(properties={"version": "0.1.9"}))
    monkeypatch.undo()
    with pytest.raises(RecordingError) as caught:
        Recording(path)
    assert str(caught.value) == f"{path}: {told}"


@pytest.mark.parametrize("content", [b"", b"RR", b"\x89MCAP0\r\n", b"frame,stamp_ns\n"])
def test_a_file_that_is_no_recording_is_told(content, tmp_path):
    (tmp_path / "x.rrd").write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.rrd: not a recording"):
        Recording(tmp_path / "x.rrd")


def test_a_recording_by_another_program_is_told(tmp_path):
    other = rr.RecordingStream("someone_else")
    other.save(tmp_path / "x.rrd")
    other.log("words", rr.TextDocument("hello"))
    other.flush()
    other.disconnect()
    with pytest.raises(RecordingError, match="by someone_else, not by roadeval"):
        Recording(tmp_path / "x.rrd")


def test_a_torn_file_is_read_to_the_last_whole_message(drive, recording, tmp_path):
    whole, path = recording.path.read_bytes(), tmp_path / "torn.rrd"
    # In the middle of a picture: cut between two messages, a file has nothing torn in it.
    path.write_bytes(whole[: whole.rindex(b"\x89PNG") + 30])
    torn = Recording(path)
    assert not torn.complete
    assert torn.frame_numbers == recording.frame_numbers
    np.testing.assert_array_equal(torn.truth(0), drive[0].frame.truth)


@pytest.mark.parametrize("has_index", [True, False])
def test_every_frame_comes_back_in_any_order(drive, recording, has_index, tmp_path):
    path = tmp_path / "again.rrd"
    path.write_bytes(recording.path.read_bytes()[: None if has_index else -1])
    again = Recording(path)
    assert again.complete == has_index
    for each in (*drive[9:], *reversed(drive)):
        np.testing.assert_array_equal(again.truth(each.frame.number), each.frame.truth)


def test_a_layout_survives_its_json():
    whole = layout(first_frame=10, rate_hz=15.0, properties={"version": "1", "frames": 3})
    assert Layout.from_json(whole.to_json()) == whole


@pytest.mark.parametrize("name", [*sorted(RESERVED), "../x", "a b", "", "größe"])
def test_a_variant_cannot_take_a_name_that_the_recording_uses_or_cannot_hold(name):
    variant = type(VARIANT)(name, "", ("post",), VARIANT.layers)
    with pytest.raises(RecordingError, match=f"named '{name}'"):
        layout(variants=(variant,))


def test_every_path_that_is_no_variants_begins_with_a_reserved_name(recording):
    tops = {path.split("/")[1] for path in paths_of(recording.path)}
    assert tops - {"filtered", "__properties"} < RESERVED


@pytest.mark.parametrize("text", ["all", "masks", "none", "worst:1", "every:10", "worst:99999999"])
def test_a_rule_is_its_kind_and_number(text):
    rule = RecordRule.parse(text)
    kind, _, number = text.partition(":")
    assert (rule.kind, rule.number) == (kind, int(number or 0))


def test_a_rule_is_checked_without_rerun():
    code = (
        "import sys; from roadeval.recording.layout import RecordRule; RecordRule.parse('all'); "
        "sys.exit('rerun' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
