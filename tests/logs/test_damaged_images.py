"""Images that are damaged, too large or otherwise not to be trusted: left out, and told."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.frames import FrameStream
from roadeval.logs.log import open_log
from roadeval.logs.settings import FrameSettings, LogConfig, TopicSettings
from tests.images.making import EXACT, LOSSY, zeroed
from tests.logs.making import compressed, grey, jpeg, png, raw, ros2_log

JPEG = LOSSY["JPEG"]
BROKEN = zeroed(JPEG, 1500)
HEIGHT, WIDTH = 48, 72


def camera(*files: bytes) -> list[tuple[str, int, dict[str, Any]]]:
    return [("/camera", i, compressed(i, data)) for i, data in enumerate(files)]


def masks(*files: bytes) -> list[tuple[str, int, dict[str, Any]]]:
    return [("/road_mask", i, compressed(i, data, "png")) for i, data in enumerate(files)]


def read(path: Path, **options: Any) -> tuple[list[Any], FrameStream]:
    """Return every frame, or the message of its error, and the stream they came from."""
    frames_or_reasons: list[Any] = []
    with open_log(path, LogConfig(frames=FrameSettings(**options))) as log:
        stream = log.frames(log.select())
        for logged in stream:
            try:
                frames_or_reasons.append(logged.decode())
            except FrameError as error:
                frames_or_reasons.append(str(error))
    return frames_or_reasons, stream


def test_a_damaged_image_is_left_out_and_named(tmp_path: Path) -> None:
    path = ros2_log(tmp_path / "a.mcap", camera(JPEG, BROKEN, JPEG))
    (first, second, third), stream = read(path)
    np.testing.assert_array_equal(first.image, third.image)
    assert second.startswith("frame 1: a damaged JPEG (Corrupt JPEG data")
    assert [*stream.accounting.undecodable] == [1]


def test_damaged_truth_costs_its_frame_and_names_its_topic(tmp_path: Path) -> None:
    mask = grey(255, WIDTH, HEIGHT)
    intact, broken = png(mask), zeroed(png(mask), 40, 3)
    path = ros2_log(tmp_path / "a.mcap", camera(JPEG, JPEG) + masks(intact, broken))
    (first, second), _ = read(path)
    assert first.truth.min() == 1
    assert second.startswith("frame 1: /road_mask: a damaged PNG")


def test_a_log_of_damaged_images_is_refused(tmp_path: Path) -> None:
    path = ros2_log(tmp_path / "a.mcap", camera(BROKEN, BROKEN))
    with pytest.raises(LogError, match=r"nothing of /camera .*: a damaged JPEG"):
        read(path)


def test_one_limit_holds_for_raw_and_compressed_images(tmp_path: Path) -> None:
    small, large = grey(9, 8, 8), grey(9, 9, 8)
    both = [("/camera", i, raw(i, image, "mono8")) for i, image in enumerate((small, large))]
    for name, messages in (("a", both), ("b", camera(jpeg(small), jpeg(large)))):
        (_, refused), _ = read(ros2_log(tmp_path / f"{name}.mcap", messages), max_pixels=64)
        assert "an image of 9x8, more than the 64 pixels" in refused


@pytest.mark.parametrize(
    ("encoding", "width", "height", "reason"),
    [("yuv422", 15, 12, "an even width"), ("nv21", 16, 11, "an even width and height")],
)
def test_colours_shared_by_pixels_need_an_even_size(
    tmp_path: Path, encoding: str, width: int, height: int, reason: str
) -> None:
    data = {"width": width, "height": height, "step": 2 * width, "data": bytes(4 * width * height)}
    image = raw(0, grey(0), encoding, **data)
    path = ros2_log(tmp_path / "a.mcap", [("/camera", 0, image)])
    with pytest.raises(LogError, match=rf"an image of {width}x{height} in {encoding}.*{reason}$"):
        read(path)


def test_messages_of_two_kinds_on_a_topic_are_read_as_what_they_are(tmp_path: Path) -> None:
    """The writer logs the second kind under the schema of the first."""
    pixels = grey(60, WIDTH, HEIGHT)
    both = [raw(0, pixels, "mono8"), compressed(1, png(pixels), "png")] * 2
    for name, order in (("a", both), ("b", both[::-1])):
        path = ros2_log(tmp_path / f"{name}.mcap", [("/camera", i, m) for i, m in enumerate(order)])
        frames, _ = read(path)
        assert [frame.image[0, 0].tolist() for frame in frames] == [[60, 60, 60]] * 4


@pytest.mark.parametrize("topic", ["truth", "shadow", "image"])
def test_a_topic_without_messages_that_was_named_is_refused(tmp_path: Path, topic: str) -> None:
    path = ros2_log(tmp_path / "a.mcap", camera(JPEG), empty=("/empty",))
    with (
        open_log(path, LogConfig(topics=TopicSettings(**{topic: "/empty"}))) as log,
        pytest.raises(LogError, match=rf"`topics\.{topic}` /empty: the topic holds no message"),
    ):
        log.select()


def test_labels_of_which_nothing_can_be_decoded_are_refused(tmp_path: Path) -> None:
    path = ros2_log(tmp_path / "a.mcap", camera(JPEG) + masks(EXACT["PNG"][:60]))
    reason = "nothing of /road_mask can be decoded: a damaged PNG"
    config = LogConfig(topics=TopicSettings(truth="/road_mask"))
    with open_log(path, config) as log, pytest.raises(LogError, match=reason):
        log.select()
