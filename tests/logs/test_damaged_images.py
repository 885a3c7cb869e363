"""Images that are damaged, too large, turned, or of samples that a log leaves open."""

import gzip
import io
import struct
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zstandard
from PIL import Image, ImageOps

from roadeval.images.decoding import size_of, to_rgb, upright
from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.frames import FrameStream
from roadeval.logs.log import describe, open_log
from roadeval.logs.messages.pictures import picture_in, turn_of
from roadeval.logs.settings import FrameSettings, LabelSettings, LogConfig, TopicSettings
from roadeval.logs.writing.writer import pack
from tests.fixtures.shared import shared
from tests.images.making import EXACT, LOSSY, scene, zeroed
from tests.logs.making import SECOND, compressed, grey, jpeg, png, raw, ros2_log

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
        pytest.raises(LogError, match="/empty holds no message") as refused,
    ):
        log.select()
    assert refused.value.setting == f"topics.{topic}"


def test_labels_of_which_nothing_can_be_decoded_are_refused(tmp_path: Path) -> None:
    path = ros2_log(tmp_path / "a.mcap", camera(JPEG) + masks(EXACT["PNG"][:60]))
    reason = "nothing of /road_mask can be decoded: a damaged PNG"
    config = LogConfig(topics=TopicSettings(truth="/road_mask"))
    with open_log(path, config) as log, pytest.raises(LogError, match=reason):
        log.select()


STAMPS = [1_700_000_000 * SECOND + i * SECOND // 10 for i in range(20)]


def stamped(
    tmp_path: Path, images: list[dict[str, Any]], labels: list[dict[str, Any]] = ()
) -> Path:
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
    return stamped(tmp_path, [compressed(STAMPS[0], jpeg(grey(90, 4, 1)))], [label])


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
    ("white", "expected", "said"),
    [(None, 200 // 16, "4095"), (1023, 200 // 4, "1023"), (65535, 0, "")],
)
def test_the_sample_that_is_white_is_the_topics_whatever_the_range(
    tmp_path: Path, white: float | None, expected: int, said: str, channels: int
) -> None:
    path = stamped(tmp_path, twelve_bits(channels))
    frames = FrameSettings(max_frames=1, white=white)
    with open_log(path, LogConfig(frames=frames)) as log:
        selection = log.select()
        assert next(log.frames(selection)).decode().image[0, 0].tolist() == [expected] * 3
        assert selection.notes == (
            (f"a sample of {said} is white; `frames.white` sets another",) if said else ()
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
    path = stamped(tmp_path, [compressed(at, jpeg(grey(level))) for at in STAMPS])
    (told,) = describe(path).picks[-1:]
    assert told.startswith(f"10 of the 10 images are {word} (frames 0, 2, 4, 6, 8 and 5 more)")


def test_a_blank_image_among_many_is_not_told(tmp_path: Path) -> None:
    levels = dict.fromkeys(STAMPS, 90) | {STAMPS[0]: 0}
    path = stamped(tmp_path, [compressed(at, jpeg(grey(level))) for at, level in levels.items()])
    with open_log(path) as log:
        stream = log.frames(log.select())
        for frame in stream:
            frame.decode()
        assert not [*stream.accounting.notes]


def exif(orientation: int) -> Image.Exif:
    made = Image.Exif()
    made[0x0112] = orientation
    return made


def turned(orientation: int, name: str = "JPEG", **options: bool) -> bytes:
    made = io.BytesIO()
    Image.fromarray(scene()).save(made, name, exif=exif(orientation), **options)
    return made.getvalue()


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("name", ["JPEG", "PNG", "TIFF", "WEBP", "AVIF"])
def test_an_orientation_turns_an_image_as_exif_defines_it(name: str, orientation: int) -> None:
    data = turned(orientation, name)
    stored = to_rgb(data, Limits())
    assert stored.shape == scene().shape
    expected = Image.fromarray(stored)
    expected.info["exif"] = exif(orientation).tobytes()
    shown = np.array(ImageOps.exif_transpose(expected))
    found = to_rgb(data, Limits(turn=True))
    np.testing.assert_array_equal(found, shown)
    assert size_of(data, Limits(turn=True)) == found.shape[1::-1]
    assert size_of(data, Limits()) == stored.shape[1::-1]


@pytest.mark.parametrize("flip", [1, -1])
@pytest.mark.parametrize("quarters", range(4))
def test_a_display_matrix_turns_each_pixel_to_its_place(quarters: int, flip: int) -> None:
    turn = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarters) @ np.diag([flip, 1])
    (a, c), (b, d) = (turn * 65536).tolist()
    matrix = struct.pack("=9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)

    pixels = np.arange(6).reshape(2, 3)
    expected = {}
    for (row, column), value in np.ndenumerate(pixels):
        x, y = turn @ (column, row)
        expected[int(value)] = y, x
    rows, columns = (np.array([place[axis] for place in expected.values()]) for axis in (0, 1))
    shown = np.zeros((np.ptp(rows) + 1, np.ptp(columns) + 1), int)
    shown[rows - rows.min(), columns - columns.min()] = [*expected]
    orientation = turn_of(SimpleNamespace(side_data={"DISPLAYMATRIX": matrix}))
    np.testing.assert_array_equal(upright(pixels, orientation), shown)


@pytest.mark.parametrize("videos", shared("failures", "reality", "turned_video"))
@pytest.mark.parametrize(("name", "turns"), [("quarter_turn", -1), ("upside_down", 2)])
def test_pack_turns_a_video_as_players_do_and_says_so(tmp_path, videos, name, turns):
    shown = []
    for each in ("plain", name):
        packed = pack(videos / f"{each}.mp4", tmp_path / f"{each}.mcap")
        assert bool(packed.warnings) == (each != "plain")
        with open_log(packed.path) as log:
            shown.append(next(log.frames(log.select())).decode().image)
    assert np.abs(np.rot90(shown[0], turns).astype(int) - shown[1]).mean() < 6


def drive(tmp_path: Path, orientation: int) -> Path:
    mask = np.zeros(scene().shape[:2], np.uint8)
    mask[:, : mask.shape[1] // 2] = 255
    messages = []
    for at in (0, 100, 200):
        messages.append(("/camera", at + 1, compressed(at, turned(orientation))))
        messages.append(("/labels", at + 2, compressed(at, png(mask), "png")))
    return ros2_log(tmp_path / "a.mcap", messages)


def test_a_replay_turns_images_unless_it_is_asked_not_to_and_says_both(tmp_path: Path) -> None:
    path = drive(tmp_path, 3)
    shown = []
    for unturned in (False, True):
        config = LogConfig(frames=FrameSettings(unturned=unturned))
        with open_log(path, config) as log:
            frame = next(log.frames(log.select())).decode()
            shown.append(frame.image)
            # The viewer of a recording turns no JPEG.
            assert frame.media_type is None
        said = describe(path, config).picks[0]
        assert ("are as stored" if unturned else "are turned, as their EXIF") in said
    np.testing.assert_array_equal(shown[0], shown[1][::-1, ::-1])


@pytest.mark.parametrize("resize", [False, True])
def test_no_label_is_scaled_whose_width_and_height_are_exchanged(tmp_path, resize):
    config = LogConfig(topics=TopicSettings(resize_truth=resize))
    with (
        open_log(drive(tmp_path, 6), config) as log,
        pytest.raises(LogError, match=r"72x48, but /camera is 48x72: one of them is turned by"),
    ):
        log.select()


def test_pack_names_images_that_their_orientation_turns(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    for number in (1, 6):
        (tmp_path / "images" / f"{number}.jpg").write_bytes(turned(number))
    (told,) = pack(tmp_path / "images", tmp_path / "a.mcap").warnings
    assert told.startswith("images that their EXIF orientation turns, in replay as in viewers: 6")
