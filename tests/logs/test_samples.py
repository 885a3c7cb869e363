"""Samples of other kinds than eight bits: whose sign, range and names a log leaves open."""

import gzip
import struct
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zstandard

from roadeval.logs.errors import BadMessage
from roadeval.logs.log import describe, open_log
from roadeval.logs.messages.pictures import picture_in
from roadeval.logs.settings import FrameSettings, LabelSettings, LogConfig, TopicSettings
from tests.logs.making import SECOND, compressed, grey, jpeg, png, raw, ros2_log

STAMPS = [1_700_000_000 * SECOND + i * SECOND // 10 for i in range(20)]


def camera(tmp_path: Path, images: list[dict[str, Any]], labels: list[dict[str, Any]] = ()) -> Path:
    messages = [("/camera", *pair) for pair in zip(STAMPS, images, strict=False)]
    messages += [("/labels", at + 1, label) for at, label in zip(STAMPS, labels, strict=False)]
    return ros2_log(tmp_path / "drive.mcap", sorted(messages, key=lambda message: message[1]))


def labels_of(path: Path, labels: LabelSettings) -> tuple[list[int], str]:
    """Return the values in the first row of the truth, and what the log's labels mean."""
    with open_log(path, LogConfig(labels=labels, topics=TopicSettings(truth="/labels"))) as log:
        selection = log.select()
        truth = next(log.frames(selection)).decode().truth
        assert truth is not None
        return truth[0].tolist(), selection.reasons[1]


def labelled(tmp_path: Path, label: dict[str, Any]) -> Path:
    return camera(tmp_path, [compressed(STAMPS[0], jpeg(grey(90, 4, 1)))], [label])


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize(
    ("encoding", "kind"), [("8SC1", "i1"), ("16SC1", "i2"), ("32SC1 \0", "i4")]
)
def test_negative_labels_are_ignored_and_said(tmp_path: Path, encoding, kind, order) -> None:
    values = np.array([[-1, 0, 3, 5]], f"{order}{kind}")
    path = labelled(tmp_path, raw(STAMPS[0], values, encoding, is_bigendian=order == ">"))
    truth, words = labels_of(path, LabelSettings(road=(3,)))
    assert truth == [255, 0, 1, 0]
    assert "values below 0 mean no label, and are ignored" in words
    assert labels_of(path, LabelSettings(road=(3,), ignore=(-1, 5)))[0] == [255, 0, 1, 255]
    assert labels_of(path, LabelSettings(road=(3, -1)))[0] == [1, 0, 1, 0]


def test_a_mask_with_negative_values_is_understood_by_itself(tmp_path: Path) -> None:
    values = np.array([[-2, 0, 1, -(2**31)]], "<i4")
    truth, words = labels_of(labelled(tmp_path, raw(STAMPS[0], values, "32SC1")), LabelSettings())
    assert truth == [255, 0, 1, 255]
    assert "road is 1; values below 0 mean no label" in words


def test_labels_in_a_depth_transport_are_those_of_its_png(tmp_path: Path) -> None:
    """image_transport puts twelve bytes before the PNG of ``compressedDepth`` (4.0, ROS 2)."""
    file = bytes(12) + png(np.array([[0, 3, 300, 3]], np.uint16))
    label = compressed(STAMPS[0], file, "16UC1; compressedDepth png")
    assert labels_of(labelled(tmp_path, label), LabelSettings(road=(3,)))[0] == [0, 1, 0, 1]


def twelve_bits(channels: int) -> list[dict[str, Any]]:
    """Return frames of a rising level, the first of which would fit into fewer bits."""
    images = [np.full((6, 8, channels), 200 * (1 + i), "<u2") for i in range(len(STAMPS))]
    if channels == 1:
        return [raw(at, i[..., 0], "mono16") for at, i in zip(STAMPS, images, strict=True)]
    return [compressed(at, png(i), "png") for at, i in zip(STAMPS, images, strict=True)]


@pytest.mark.parametrize("channels", [1, 3, 4], ids=["grey", "RGB", "RGBA"])
@pytest.mark.parametrize(
    ("white", "expected", "shown"),
    [(None, 200 // 16, "4095"), (1023, 200 // 4, "1023"), (65535, 0, "")],
)
def test_the_sample_that_is_white_is_the_topics_whatever_the_range(
    tmp_path: Path, white: float | None, expected: int, shown: str, channels: int
) -> None:
    path = camera(tmp_path, twelve_bits(channels))
    frames = FrameSettings(max_frames=1, white=white)
    with open_log(path, LogConfig(frames=frames)) as log:
        selection = log.select()
        assert next(log.frames(selection)).decode().image[0, 0].tolist() == [expected] * 3
        assert selection.notes == (
            (f"a sample of {shown} is white; `frames.white` sets another",) if shown else ()
        )


@pytest.mark.parametrize("pack", [zstandard.compress, gzip.compress])
@pytest.mark.parametrize("harm", ["bomb", "cut", "noise"])
def test_a_packed_image_that_is_damaged_is_refused_in_bounded_memory(pack, harm: str) -> None:
    data = pack(bytes(100_000_000 if harm == "bomb" else 48))
    data = {"bomb": data, "cut": data[:9], "noise": data[:2] + b"noise"}[harm]
    message = SimpleNamespace(header=SimpleNamespace(stamp="0", frame_id=""), format="zstd")
    message.data = struct.pack("<IIBII", 6, 8, 0, 8, 5) + b"mono8" + data
    with suppress(BadMessage):
        assert len(picture_in(message).data) <= 4 * 48


@pytest.mark.parametrize(("level", "word"), [(0, "black"), (9, "black"), (250, "white")])
def test_a_camera_whose_images_are_blank_is_told(tmp_path: Path, level: int, word: str) -> None:
    path = camera(tmp_path, [compressed(at, jpeg(grey(level))) for at in STAMPS])
    (pick,) = describe(path).picks[-1:]
    assert pick.startswith(f"10 of the 10 images are {word} (frames 0, 2, 4, 6, 8 and 5 more)")


def test_a_blank_image_among_many_is_not_told(tmp_path: Path) -> None:
    levels = dict.fromkeys(STAMPS, 90) | {STAMPS[0]: 0}
    path = camera(tmp_path, [compressed(at, jpeg(grey(level))) for at, level in levels.items()])
    with open_log(path) as log:
        stream = log.frames(log.select())
        for frame in stream:
            frame.decode()
        assert not [*stream.accounting.notes]
