"""Frames and truth out of a log of every kind of camera; its times, and its identity."""

import hashlib
import random
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from mcap.writer import CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from roadeval.logs import log
from roadeval.logs.container import file, records
from roadeval.logs.container.records import FileBytes
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.frames import LoggedFrame, Selection
from roadeval.logs.log import Log, describe, open_log
from roadeval.logs.settings import (
    FrameSettings,
    LabelPlace,
    LogConfig,
    TopicSettings,
    parse_time,
)
from roadeval.logs.topics import reader
from roadeval.logs.topics.reader import UNREADABLE
from tests.fixtures.flavours import FLAVOURS, file_fields, foxglove_json, in_json, scenes
from tests.fixtures.shared import both, shared
from tests.logs.making import (
    COMPRESSED,
    SECOND,
    compressed,
    drive,
    frames,
    grey,
    jpeg,
    png,
    raw,
    ros2_log,
)

START = 1_700_000_000_123_456_789
STAMPS = [START + i * SECOND // 10 for i in range(10)]


def read(path: Path, **settings: Any) -> tuple[Selection, list[LoggedFrame]]:
    with open_log(path, LogConfig(**settings)) as log:
        selection = log.select()
        return selection, [*log.frames(selection)]


@pytest.mark.parametrize(
    ("topics", "setting", "reason"),
    [
        ({"image": "/labels", "truth": "/labels"}, "topics.truth", "/labels is the image's own"),
        ({"masks": {"net": "/labels"}}, "topics.masks.net", "/labels is the truth"),
    ],
)
def test_a_topic_is_not_scored_against_itself(
    tmp_path: Path, topics: Any, setting: str, reason: str
) -> None:
    path = drive(tmp_path / "drive.mcap", STAMPS, STAMPS)
    with pytest.raises(LogError, match=reason) as refused:
        read(path, topics=TopicSettings(**topics))
    assert (refused.value.where, refused.value.setting) == ("drive.mcap", setting)


@pytest.mark.parametrize(("first", "labelled"), [(START, 10), (0, 1)])
def test_labels_with_zero_stamps_are_paired_by_log_times(tmp_path, first, labelled):
    """A camera whose own stamps begin at zero may have one label, of its first image."""
    mask = np.vstack([grey(0, height=3), grey(255, height=3)])
    messages: list[tuple[str, int, Any]] = []
    for number, logged in enumerate(STAMPS):
        messages.append(("/camera", logged, compressed(first + number, jpeg(grey(99)))))
        messages.append(("/labels", logged + 7, raw(0, mask, "mono8")))
    messages = messages if first else [*messages[::2], messages[1]]
    path = ros2_log(tmp_path / "drive.mcap", sorted(messages, key=lambda message: message[1]))
    selection, frames = read(path, topics=TopicSettings(sync_tolerance_ms=0 if not first else None))
    assert [frame.labelled for frame in frames] == [True] * labelled + [False] * (10 - labelled)
    assert bool(selection.truth.notes) == bool(first)


@pytest.mark.parametrize(
    ("frames", "numbers"),
    [
        ({"start": "0.2", "end": "0.5"}, [2, 3, 4]),
        ({"start": str(STAMPS[7])}, [7, 8, 9]),
        ({"start": "0.1", "every": 3, "max_frames": 2}, [1, 4]),
    ],
)
def test_a_range_is_half_open_and_keeps_the_numbers(
    tmp_path: Path, frames: Any, numbers: list[int]
) -> None:
    _, logged = read(drive(tmp_path / "drive.mcap", STAMPS), frames=FrameSettings(**frames))
    assert [frame.number for frame in logged] == numbers


@pytest.mark.parametrize(
    ("images", "labels", "stamps", "reason"),
    [
        ([10, 20, 30], [12, 22, 32], [10, 20, 30], "in place of them: log times"),
        ([7, 7, 7], [9, 9, 9], [7, 7, 7], "in place of them: their order"),
        ([7, 7], [7], [], "in place of them: their order"),
    ],
)
def test_log_times_or_the_order_take_the_place_of_zero_stamps(
    tmp_path: Path, images: list[int], labels: list[int], stamps: list[int], reason: str
) -> None:
    mask = png(grey(255))
    messages = [("/cam", time, compressed(0, jpeg(grey(9)))) for time in images]
    messages += [("/labels", time, compressed(0, mask, "png")) for time in labels]
    path = ros2_log(tmp_path / "zero.mcap", sorted(messages, key=lambda message: message[1]))
    selection, frames = read(path)
    assert [frame.stamp_ns for frame in frames if frame.labelled] == stamps
    assert any(reason in sentence for sentence in selection.reasons)


@pytest.mark.parametrize("kind", list(CompressionType))
def test_chunks_too_big_for_memory_are_read_all_the_same(tmp_path, kind, monkeypatch):
    path = drive(tmp_path / "drive.mcap", STAMPS, STAMPS, compression=kind)
    monkeypatch.setattr(records, "IN_MEMORY", 1000)
    monkeypatch.setattr(records, "BLOCK", 100)
    with open_log(path) as log:
        log.verify()
        frames = [frame.decode() for frame in log.frames(log.select())]
    assert [frame.stamp_ns for frame in frames] == STAMPS
    assert log.damage == ()


@pytest.mark.parametrize("stamp", [2**63 - 1, 2**63, 10**40, -(10**40)])
def test_a_stamp_beyond_all_clocks_cannot_be_read(tmp_path, stamp):
    sec, nsec = divmod(stamp, SECOND)
    log = in_json(("foxglove.CompressedImage", "jsonschema", b"{}"),
                  lambda _: {"timestamp": {"sec": sec, "nsec": nsec}}, file_fields)  # fmt: skip
    (tmp_path / "drive.mcap").write_bytes(log.bytes())
    with open_log(tmp_path / "drive.mcap") as log:
        (camera,) = log.readers.values()
        assert camera.stamp(0) == (stamp if stamp == 2**63 - 1 else UNREADABLE)


@pytest.mark.parametrize("used", ["foxglove.CompressedImage", "drive.Event"])
def test_a_topic_carries_what_its_messages_are_and_not_a_channel_without_one(tmp_path, used):
    path = tmp_path / "drive.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {
            name: writer.register_channel(
                "/camera", "json", writer.register_schema(name, "jsonschema", b"{}")
            )
            for name in sorted(("drive.Event", "foxglove.CompressedImage"), key=used.__eq__)
        }
        image = foxglove_json("CompressedImage", file_fields).messages[0].data
        writer.add_message(channels[used], log_time=START, publish_time=START, data=image)
        writer.finish()
    with open_log(path) as log:
        (topic,) = log.topics
        assert (topic.schema, topic.count) == (used, 1)
        if topic.is_image:
            assert len([*log.frames(log.select())]) == 1
        else:
            with pytest.raises(LogError, match=r"no image topic; the log has: /camera"):
                log.select()


# --- All that there is to say about a log, as plain data ------------------------------------------


@pytest.mark.parametrize("apart", [0, 50])
def test_images_that_repeat_others_are_told_wherever_they_lie(tmp_path: Path, apart: int) -> None:
    images = [compressed(1 + i, jpeg(grey(20 * i))) for i in range(3)]
    messages = [("/camera", 1 + i + again * apart, images[i]) for again in (0, 1) for i in range(3)]
    messages.append(("/camera", 100, compressed(3, jpeg(grey(200)))))  # an old stamp
    path = ros2_log(tmp_path / "a.mcap", sorted(messages, key=lambda message: message[1]))
    (*_, last) = read(path)[1]
    (note,) = last.accounting.notes
    assert note.startswith("3 of the 7 images repeat an earlier one, by stamp and content")


def chunks_read(log: Log, monkeypatch: pytest.MonkeyPatch) -> set[int]:
    """Return a set that fills with the places of the chunks that are read from now on."""
    read, read_chunk = set[int](), records.ChunkReader.read
    log.containers[0].reader._cache.clear()

    def noted(reader: records.ChunkReader, chunk: records.Chunk) -> records.Bytes:
        read.add(chunk.offset)
        return read_chunk(reader, chunk)

    monkeypatch.setattr(records.ChunkReader, "read", noted)
    return read


@pytest.mark.parametrize("apart", [1, 7])
@pytest.mark.parametrize("delay", [0, 900])
def test_labelled_frames_are_found_by_their_labels_alone(tmp_path, apart, delay, monkeypatch):
    stamps = range(1000, 9000, 100)
    image, mask = jpeg(grey(9)), grey(0)
    mask[3:] = 255
    messages = [("/camera", stamp, compressed(stamp, image)) for stamp in stamps]
    messages += [
        ("/labels", stamp + delay, raw(stamp, mask, "mono8")) for stamp in stamps[3::apart]
    ]
    messages.sort(key=lambda message: message[1])
    path = ros2_log(tmp_path / "a.mcap", messages, chunk_size=1)
    tolerance = TopicSettings(sync_tolerance_ms=1e-3)
    with open_log(path, LogConfig(topics=tolerance, frames=FrameSettings(every=2))) as log:
        selection = log.select()
        expected = [frame.number for frame in log.frames(selection) if frame.labelled]
        read = chunks_read(log, monkeypatch)
        numbers = [frame.number for frame in log.frames(selection, labelled=True)]
    assert numbers == expected
    assert apart == 1 or len(read) < len(stamps)


@pytest.mark.parametrize(
    "frames",
    [
        FrameSettings(max_frames=16),
        FrameSettings(start="20001000ns", end="20002600ns"),
        FrameSettings(every=20, max_frames=8),
        FrameSettings(labelled=True, max_frames=3),
        FrameSettings(labelled=True, start="20001000ns", end="20002600ns"),
    ],
)
def test_labels_are_paired_only_within_the_range(tmp_path, frames, monkeypatch):
    monkeypatch.setattr(reader, "SMALL", 0)
    stamps = range(20_000_000, 20_024_000, 100)
    image, mask = jpeg(grey(9)), grey(0)
    mask[3:] = 255
    messages = [("/camera", stamp, compressed(stamp, image)) for stamp in stamps]
    messages += [("/labels", stamp + 50, raw(stamp, mask, "mono8")) for stamp in stamps[::4]]
    messages.sort(key=lambda message: message[1])
    path = ros2_log(tmp_path / "a.mcap", messages, chunk_size=1)
    topics = TopicSettings(sync_tolerance_ms=5e-5)
    monkeypatch.setattr(reader, "SMALL", 0)  # of small logs all stamps are read
    with open_log(path, LogConfig(topics=topics, frames=frames)) as log:
        selection = log.select()
        read = chunks_read(log, monkeypatch)
        numbers = [frame.number for frame in log.frames(selection, labelled=True)]
        assert len(numbers) >= 3
        assert all(number % 4 == 0 for number in numbers)
        assert len(read) < len(messages) / 8


@pytest.mark.parametrize("future", [0, 5_000_000])
@pytest.mark.parametrize(("late", "jitter"), [(0, 0), (70, 0), (-400, 0), (70, 60), (3000, 300)])
def test_of_few_frames_each_has_the_label_that_it_has_among_all(
    tmp_path: Path, late: int, jitter: int, future: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Labels are logged later than images, more or less, and one frame's stamps lie ahead."""
    monkeypatch.setattr(reader, "SMALL", 0)
    chance, mask = random.Random(late), grey(0)
    mask[3:] = 255
    messages = []
    for number in range(200):
        stamp = 20_000_000 + 100 * number + future * (number == 40)
        at = 20_000_000 + 100 * number + chance.randint(0, jitter)
        messages.append(("/camera", at, compressed(stamp, jpeg(grey(number)))))
        if number % 4 == 0:
            at += late + chance.randint(0, jitter)
            stamp += 0 if future else chance.randint(-20, 20)
            messages.append(("/labels", at, raw(stamp, mask, "mono8")))
    messages.sort(key=lambda message: message[1])
    path = ros2_log(tmp_path / "a.mcap", messages, chunk_size=1)
    labelled = []
    for every in (1, 10):
        config = LogConfig(frames=FrameSettings(every=every))
        with open_log(path, config) as log:
            selection = log.select()
            read = chunks_read(log, monkeypatch)
            stream = log.frames(selection)
            labelled.append({f.number: f.labelled for f in stream if f.number % 10 == 0})
    assert labelled[0] == labelled[1]
    assert sum(labelled[1].values()) == 10 or jitter > 100
    assert jitter or future or len(read) < 50


def two_cameras(path: Path, names: list[str]) -> Path:
    """Write a log in which a topic's images, and their labels, are of these cameras in turn."""
    messages = []
    for number, name in enumerate(names):
        stamp = SECOND * (number + 1)
        for topic, value in (("/camera", number), ("/labels", 0)):
            message = compressed(stamp, png(grey(value)))
            message["header"]["frame_id"] = name
            messages.append((topic, stamp, message))
    return ros2_log(path, messages)


@pytest.mark.parametrize(
    "names", [["front", "rear"] * 6, ["front"] * 20 + ["rear"] * 4, ["a", "b", "c"] * 5]
)
def test_several_cameras_of_one_topic_are_told_and_one_can_be_chosen(tmp_path, names):
    path = two_cameras(tmp_path / "a.mcap", names)
    _, frames = read(path)
    assert len(frames) == len(names)
    (note,) = (note for note in frames[0].accounting.notes if "several cameras" in note)
    assert f"{names[0]} ({names.count(names[0])})" in note
    assert "`topics.frame_id` chooses one" in note
    for name in {*names}:
        _, frames = read(path, topics=TopicSettings(frame_id=name, truth="/labels"))
        numbers = [number for number, other in enumerate(names) if other == name]
        assert [frame.number for frame in frames] == numbers
        assert not any("several cameras" in note for note in frames[0].accounting.notes)


@pytest.mark.parametrize("offset_ms", [0.0, 5.0])
@pytest.mark.parametrize("chosen", [None, "left", "middle", "right"])
def test_of_cameras_with_one_stamp_the_one_that_a_label_names_has_it(tmp_path, chosen, offset_ms):
    messages, names = [], ["left", "middle", "right"]
    for second in range(1, 8):
        for place, name in enumerate(names):
            message = compressed(second * SECOND, png(grey(place)))
            message["header"]["frame_id"] = name
            messages.append(("/camera", second * SECOND + place, message))
        stamp = second * SECOND - round(offset_ms * 1e6)
        label = compressed(stamp, png(grey(255)))
        label["header"]["frame_id"] = "middle"
        messages.append(("/labels", second * SECOND + 9, label))
    path = ros2_log(tmp_path / "a.mcap", messages)
    _, frames = read(
        path, topics=TopicSettings(frame_id=chosen, truth="/labels", sync_offset_ms=offset_ms)
    )
    of_frames = [chosen] * 7 if chosen else names * 7
    assert [frame.labelled for frame in frames] == [name == "middle" for name in of_frames]


@pytest.mark.parametrize("others", [1, 4])
def test_messages_of_another_kind_on_the_topic_of_images_are_no_images(tmp_path, others):
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        texts = {"sensor_msgs/msg/CompressedImage": COMPRESSED, "sensor_msgs/msg/CameraInfo": ""}
        image, other = (
            writer.register_channel("/c", "cdr", writer.register_schema(n, "ros2msg", t.encode()))
            for n, t in texts.items()
        )
        encode = serialize_dynamic("sensor_msgs/msg/CompressedImage", COMPRESSED)
        for number in range(6):
            for place in range(others):
                writer.add_message(other, number * SECOND + place, bytes(9), 0)
            message = compressed(number * SECOND, png(grey(number)))
            data = encode["sensor_msgs/msg/CompressedImage"](message)
            writer.add_message(image, number * SECOND + others, data, 0)
        writer.finish()
    with open_log(path, every_topic=True) as log:
        assert (log.topics[0].count, log.topics[0].rate_hz) == (6, 1.0)
        frames = [frame.decode() for frame in log.frames(log.select())]
    assert [frame.image.max() for frame in frames] == list(range(6))


@pytest.mark.parametrize(("name", "told"), [(None, 0), ("rear", 1)])
def test_numbers_of_labels_are_told_to_count_the_images_of_all_cameras(tmp_path, name, told):
    path = two_cameras(tmp_path / "a.mcap", ["front", "rear"] * 3)
    (tmp_path / "labels").mkdir()
    for number in range(3):
        (tmp_path / "labels" / f"{number}.png").write_bytes(png(grey(255 * (number > 0))))
    config = LogConfig(
        truth=LabelPlace(str(tmp_path / "labels")), topics=TopicSettings(frame_id=name)
    )
    with open_log(path, config) as log:
        notes = log.select().truth.notes
    assert len(notes) == told
    assert all("also those that `topics.frame_id` leaves out" in note for note in notes)


def labels_stamped(path, stamps):
    """Write a log of six images, with a label under each of some stamps, a moment later."""
    messages = []
    for number in range(6):
        time = SECOND * (number + 1)
        messages.append(("/camera", time, compressed(time, png(grey(number)))))
        messages.append(("/labels", time + 9, compressed(stamps(time), png(grey(255)))))
    return ros2_log(path, messages)


def test_labels_without_stamps_are_paired_by_log_times(tmp_path: Path) -> None:
    selection, frames = read(labels_stamped(tmp_path / "a.mcap", lambda time: 0))
    assert [frame.labelled for frame in frames] == [True] * 6
    (note,) = selection.truth.notes
    assert note.startswith("its stamps are 0, so log times pair it: what was logged late")


def test_labels_that_share_a_stamp_are_not_told_to_be_too_far_away(tmp_path: Path) -> None:
    seconds = {1: 1, 2: 1, 3: 3, 4: 3, 5: 3, 6: 6}
    path = labels_stamped(tmp_path / "a.mcap", lambda time: seconds[time // SECOND] * SECOND)
    with open_log(path, LogConfig()) as log:
        stream = log.frames(log.select())
        assert [frame.labelled for frame in stream] == [True, False, True, False, False, True]
        (told,) = stream.unpaired()
    assert told.endswith("belong to no frame: the frame 0.0 ms from the first has another label")


def test_a_camera_that_no_image_names_is_refused(tmp_path: Path) -> None:
    path = two_cameras(tmp_path / "a.mcap", ["front", "rear"])
    with pytest.raises(LogError, match="no image of the range has left; the first has front"):
        read(path, topics=TopicSettings(frame_id="left", truth=""))


@pytest.mark.parametrize(("apart", "repeated"), [(1, 0), (2, 6), (3, 8)])
def test_a_label_under_several_stamps_is_told(tmp_path: Path, apart: int, repeated: int) -> None:
    """A converter may repeat each label under the stamps of the frames between."""
    messages = []
    for number in range(12):
        mask = grey(0)
        mask[: 1 + number // apart % 6, : 1 + number // apart] = 255
        messages.append(("/camera", number + 1, compressed(number + 1, png(grey(number)))))
        messages.append(("/labels", number + 1, compressed(number + 1, png(mask))))
    _, frames = read(ros2_log(tmp_path / "a.mcap", messages))
    notes = [note for note in frames[-1].accounting.notes if "labels repeat" in note]
    assert [note.split(" labels")[0] for note in notes] == [f"{repeated} of the 12"] * (
        repeated > 0
    )


SECOND = 1_000_000_000


@pytest.mark.parametrize(
    ("text", "ns", "relative"),
    [
        ("2.5", 2_500_000_000, True),
        ("90", 90 * SECOND, True),
        (".25", 250_000_000, True),
        ("0", 0, True),
        ("12s", 12 * SECOND, True),
        ("12ns", 12, False),
        ("1700000000123456789", 1_700_000_000_123_456_789, False),
        ("2.123456789", 2_123_456_789, True),
        ("1970-01-01T00:00:01.000000005Z", SECOND + 5, False),
        ("2023-11-14T23:13:20+01:00", 1_700_000_000 * SECOND, False),
    ],
)
def test_a_time_is_read_to_the_nanosecond(text: str, ns: int, relative: bool) -> None:
    assert parse_time(text) == ns
    assert parse_time(text, start_ns=7) == ns + 7 * relative


@pytest.mark.parametrize(
    "text",
    [
        "",
        ".",
        "9" * 5_000,
        "9" * 5_000 + ".5",
        "9" * 5_000 + "ns",
        "soon",
        "-3",
        "1e9",
        "2023-11-14",
        "2023-13-01T00:00:00Z",
    ],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(LogError, match="is not a time"):
        parse_time(text)


Rgb = npt.NDArray[np.uint8]

REFUSED = {
    "ros2_CompressedImage_compressedDepth": "it holds depth",
    "ros2_Image_bgr8_shortdata": r"(5084|56600) bytes of pixels where (5184|57600) are needed",
}


def cases(*shows: str) -> pytest.MarkDecorator:
    names = [f"{name}.mcap" for name, flavour in FLAVOURS.items() if flavour.shows in shows]
    return pytest.mark.parametrize("log", both("flavours", *names), indirect=True)


def expected(log: Path, *, grey: bool) -> list[Rgb]:
    """Return the frames that a log was made from: those beside it, or ours."""
    beside = sorted(log.parent.glob("expected_*.png"))
    found = [cv2.imread(str(path))[..., ::-1] for path in beside] if beside else scenes()
    if not grey:
        return found
    return [cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)[..., None].repeat(3, axis=2) for rgb in found]


@pytest.mark.parametrize("folder", shared("mcap", "flavours"))
def test_every_shared_flavour_is_among_ours(folder: Path) -> None:
    assert {path.stem for path in folder.glob("*.mcap")} <= set(FLAVOURS)


@cases("colour", "grey")
def test_frames_are_those_expected(log: Path) -> None:
    flavour, found = FLAVOURS[log.stem], frames(log)
    assert len(found) == 5
    for frame, wanted in zip(found, expected(log, grey=flavour.shows == "grey"), strict=True):
        assert np.abs(frame.image.astype(int) - wanted).mean() <= flavour.error


@cases("colour", "grey", "video")
def test_the_cameras_own_name_is_read(log: Path) -> None:
    with open_log(log) as opened:
        assert all(topic.frame_id in {"camera", "cam"} for topic in opened.topics if topic.is_image)


@cases("nothing")
def test_what_is_no_image_is_called_by_its_name(log: Path) -> None:
    with pytest.raises((LogError, FrameError), match=REFUSED[log.stem]):
        frames(log)


CHUNK = 100_000
FRAMES = 40


def write(
    path: Path, *, size: int = CHUNK, frames: int = FRAMES, chunks=True, crcs=True, seed: int = 0
) -> Path:
    """Write a log of noise, a chunk each message, with data that a checksum alone can tell."""
    noise = np.random.default_rng(seed)
    options = {"chunk_size": size, "compression": CompressionType.NONE}
    with path.open("wb") as file:
        writer = Writer(file, **options, use_chunking=chunks, enable_crcs=crcs)
        writer.start()
        schema = writer.register_schema("Noise", "ros2msg", b"uint8[] data")
        channel = writer.register_channel("/noise", "cdr", schema)
        for number in range(frames):
            writer.add_message(channel, number * 10**8, noise.bytes(size), number * 10**8)
        writer.finish()
    return path


def digest(path: Path) -> str:
    with open_log(path) as opened:
        return opened.digest


@pytest.fixture
def noise(tmp_path):
    return write(tmp_path / "noise.mcap")


@pytest.mark.parametrize("kind", [{}, {"crcs": False}, {"chunks": False}])
def test_a_log_has_one_digest_wherever_it_lies_and_another_log_another(tmp_path, kind):
    first = write(tmp_path / "a.mcap", **kind)
    (tmp_path / "there").mkdir()
    assert digest(shutil.copy(first, tmp_path / "there" / "b.mcap")) == digest(first)
    if kind.get("chunks", True):
        assert digest(write(tmp_path / "c.mcap", seed=1, **kind)) != digest(first)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(first.read_bytes()[: -2 * CHUNK])
    assert digest(cut) != digest(first)


def test_the_digest_of_a_folder_is_that_of_its_files_in_order(tmp_path):
    digests = []
    for seeds in ((0, 1), (1, 0)):
        folder = tmp_path / str(seeds)
        folder.mkdir()
        for place, seed in enumerate(seeds):
            write(folder / f"log_{place}.mcap", seed=seed)
        digests.append(digest(folder))
    assert digests[0] != digests[1]


def test_a_byte_that_changed_inside_a_chunk_is_found_by_verifying(noise, tmp_path):
    content = bytearray(noise.read_bytes())
    content[len(content) // 2] ^= 0xFF
    other = tmp_path / "other.mcap"
    other.write_bytes(content)
    assert digest(other) == digest(noise)
    intact, damaged = describe(noise, verify=True), describe(other, verify=True)
    assert intact.sha256 == hashlib.sha256(noise.read_bytes()).hexdigest()
    assert damaged.sha256 == hashlib.sha256(other.read_bytes()).hexdigest()
    assert not intact.losses
    assert damaged.losses


def test_of_a_large_log_the_messages_are_not_read_unless_asked(noise, monkeypatch):
    read = []

    class Counted(FileBytes):
        def __getitem__(self, part):
            data = super().__getitem__(part)
            read.append(len(data))
            return data

    for module in (records, file):
        monkeypatch.setattr(module, "FileBytes", Counted)
    monkeypatch.setattr(log, "SMALL", CHUNK)
    description = describe(noise)
    assert (description.verified, description.sha256) == (False, None)
    assert [topic.count for topic in description.topics] == [FRAMES]
    assert sum(read) < noise.stat().st_size / 4
    steps = []
    assert describe(noise, verify=True, on_bytes=lambda *step: steps.append(step)).verified
    done, total = steps[-1]
    assert total == 2 * noise.stat().st_size
    assert 0.9 * total < done <= total
    assert [one for one, _ in steps] == sorted(one for one, _ in steps)
