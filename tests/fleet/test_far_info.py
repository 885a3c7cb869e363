"""`info` of a log behind a URL: its summary and first messages, in a few requests."""

import io
import struct
import tracemalloc
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_ros2.writer import Writer as Ros2Writer
from rich.console import Console

import roadeval
from benchmarks.long_logs import MESSAGES
from roadeval.cli.screens import info as screen
from roadeval.logs.settings import LabelPlace, LogConfig
from tests.fleet.serving import Server, s3_is_at
from tests.logs.making import PERIOD, START, compressed, grey, jpeg, raw, ros2_log
from tests.logs.topics.test_calibration import TREE, info, transforms

DEMO = Path(__file__).parents[2] / "recordings" / "demo.mcap"
"""300 messages: a camera, and masks of the road and of the shadow."""


@pytest.fixture
def server(tmp_path):
    with Server(tmp_path) as server:
        yield server


def demo_log(path, *, chunk_size=1 << 17, compression=CompressionType.ZSTD):
    """Write the first frames of the demo with chunks of another kind."""
    with DEMO.open("rb") as source, path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=compression)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.id not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id
                )
            arguments = message.log_time, message.data, message.publish_time, message.sequence
            writer.add_message(channels[channel.id], *arguments)
        writer.finish()
    return path


def shown(drive, **options):
    """What `info` says of a drive, and its lines on the screen but for that on what was read."""
    description = roadeval.info(drive, **options)
    out = Console(width=120, file=io.StringIO())
    screen.show(description, out)
    lines = out.file.getvalue().replace(str(drive), "DRIVE").splitlines()
    lines += [*description.damage, *description.losses]
    return description, [line for line in lines if not line.startswith("read ")]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [1 << 14, 1 << 17, 1 << 20, 1 << 30])
def test_a_few_requests_tell_what_the_file_on_a_disk_tells(
    server, tmp_path, compression, chunk_size
):
    path = demo_log(tmp_path / "drive.mcap", chunk_size=chunk_size, compression=compression)
    far, lines = shown(server.url("drive.mcap"))
    assert lines == shown(path)[1]
    assert (far.by_summary, far.verified, far.digest, far.sha256) == (True, False, "", None)
    assert len(server.requests) <= 10
    assert server.sent <= 1_000_000
    assert (far.traffic.requests, far.traffic.bytes) == (len(server.requests), server.sent)


def test_a_line_tells_what_was_read_and_what_was_not(server, tmp_path):
    demo_log(tmp_path / "drive.mcap")
    description = roadeval.info(server.url("drive.mcap"))
    out = Console(width=120, file=io.StringIO())
    screen.show(description, out)
    amount = f"{server.sent / 1e6:.1f} of 6.6 MB in {len(server.requests)} requests"
    line = f"read {amount}: the log's summary and first messages; --verify checks every chunk"
    assert out.file.getvalue().splitlines()[1] == line


def test_a_log_in_a_bucket_is_read_by_its_summary(server, tmp_path, monkeypatch):
    demo_log(tmp_path / "drive.mcap")
    s3_is_at(server.url(""), monkeypatch)
    description = roadeval.info("s3://bucket/drive.mcap")
    assert description.by_summary
    assert len(server.requests) <= 10


def chunks_of(path):
    with path.open("rb") as file:
        return make_reader(file).get_summary().chunk_indexes


def spoil(path, chunk):
    """Change the last byte of a chunk's data."""
    content = bytearray(path.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length - 1] ^= 0xFF
    path.write_bytes(content)


def test_a_damaged_chunk_is_told_if_all_are_verified_and_on_a_disk(server, tmp_path):
    path = demo_log(tmp_path / "drive.mcap", compression=CompressionType.NONE)
    spoil(path, chunks_of(path)[5])
    on_disk, lines = shown(path)
    assert len(on_disk.damage) == 1
    verified, verified_lines = shown(server.url("drive.mcap"), verify=True)
    assert (verified.verified, verified.sha256, verified_lines) == (True, on_disk.sha256, lines)
    assert shown(server.url("drive.mcap"))[0].damage == ()


def test_damage_where_the_first_messages_lie_is_told(server, tmp_path):
    path = demo_log(tmp_path / "drive.mcap", chunk_size=1 << 14)
    spoil(path, chunks_of(path)[0])
    far, lines = shown(server.url("drive.mcap"))
    assert not far.by_summary
    assert lines == shown(path)[1]
    assert far.losses


def test_a_description_that_is_another_one_in_the_first_chunk_is_told(server, tmp_path):
    path = demo_log(tmp_path / "drive.mcap", chunk_size=1 << 20, compression=CompressionType.NONE)
    path.write_bytes(path.read_bytes().replace(b"foxglove.Comp", b"foxglove.Camp", 1))
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (False, shown(path)[1])
    assert far.losses


@pytest.mark.parametrize("left", [-1, 0.5])
def test_a_log_without_a_summary_is_read_as_on_a_disk(server, tmp_path, left):
    path = demo_log(tmp_path / "drive.mcap")
    content = path.read_bytes()
    path.write_bytes(content[: left if left < 0 else int(len(content) * left)])
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (False, shown(path)[1])


FAR_AWAY = 1 << 62
CHUNK_INDEX = struct.Struct("<QQQQI")


def rewrite_summary(path, change, changed=Opcode.CHUNK_INDEX):
    """Change the body of records by a function; the summary has no checksum then."""
    content = bytearray(path.read_bytes())
    footer = len(content) - 8 - 20
    (at,) = struct.unpack_from("<Q", content, footer)
    while at < footer - 9:
        opcode, length = struct.unpack_from("<BQ", content, at)
        body = content[at + 9 : at + 9 + length]
        if opcode == changed:
            change(body)
            content[at + 9 : at + 9 + length] = body
        at += 9 + length
    content[footer + 16 : footer + 20] = bytes(4)
    path.write_bytes(content)


def is_elsewhere(body):
    """The chunk lies outside the file."""
    struct.pack_into("<Q", body, 16, FAR_AWAY)


def is_moved(body):
    """The chunk lies some bytes from where it is said to lie."""
    (start,) = struct.unpack_from("<Q", body, 16)
    struct.pack_into("<Q", body, 16, start + 9)


def is_long(body):
    """The chunk has more bytes than the file."""
    struct.pack_into("<Q", body, 24, FAR_AWAY)
    struct.pack_into("<Q", body, len(body) - 16, FAR_AWAY - 49)


def is_large(body):
    """The chunk holds more bytes than a disk."""
    struct.pack_into("<Q", body, len(body) - 8, FAR_AWAY)


def has_long_indexes(body):
    """The indexes of the chunk have more bytes than the file."""
    (map_size,) = struct.unpack_from("<I", body, 32)
    struct.pack_into("<Q", body, 36 + map_size, FAR_AWAY)


def has_no_channels(body):
    """The channels of the chunk are other ones than the summary describes."""
    (map_size,) = struct.unpack_from("<I", body, 32)
    for at in range(36, 36 + map_size, 10):
        struct.pack_into("<H", body, at, 999)


def is_late(body):
    """The messages of the chunk are from another time."""
    struct.pack_into("<QQ", body, 0, FAR_AWAY, FAR_AWAY)


def is_last_beyond_time(body):
    """All chunks but the first end later than a signed number of 64 bits can tell."""
    if struct.unpack_from("<Q", body, 16)[0] > 1000:
        struct.pack_into("<Q", body, 8, (1 << 63) + 5)


LIES = (
    *(is_elsewhere, is_moved, is_long, is_large),
    *(has_long_indexes, has_no_channels, is_late, is_last_beyond_time),
)


@pytest.mark.parametrize("lie", LIES)
def test_a_summary_that_lies_is_not_believed(server, tmp_path, lie):
    path = demo_log(tmp_path / "drive.mcap")
    rewrite_summary(path, lie)
    tracemalloc.start()
    far, lines = shown(server.url("drive.mcap"))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (far.by_summary, lines) == (False, shown(path)[1])
    assert peak < 100 << 20


def test_a_summary_that_lists_fewer_chunks_than_it_counts_is_not_believed(server, tmp_path):
    path = demo_log(tmp_path / "drive.mcap")
    count = struct.pack("<I", len(chunks_of(path)) + 1)
    rewrite_summary(path, lambda body: body.__setitem__(slice(22, 26), count), Opcode.STATISTICS)
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (False, shown(path)[1])


def test_a_summary_without_a_checksum_does(server, tmp_path):
    path = demo_log(tmp_path / "drive.mcap")
    rewrite_summary(path, lambda body: None)
    assert roadeval.info(server.url("drive.mcap")).by_summary


def labelled(path, masks, **options):
    """Write a drive with a mask for each frame."""
    noise = np.random.default_rng(0)
    messages = []
    for number, mask in enumerate(masks):
        time = START + number * PERIOD
        pixels = noise.integers(0, 255, (64, 64, 3), dtype=np.uint8)
        messages += [
            ("/camera", time, compressed(time, jpeg(pixels))),
            ("/labels", time, raw(time, mask, "mono8")),
        ]
    return ros2_log(path, messages, **options)


def test_masks_that_show_no_road_at_first_are_read_farther(server, tmp_path):
    masks = [np.full((64, 64), number >= 25, np.uint8) for number in range(40)]
    path = labelled(tmp_path / "drive.mcap", masks, chunk_size=1 << 13)
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (False, shown(path)[1])
    assert any("a mask of 0 1: road is 1" in line for line in lines)


def test_a_rate_is_that_of_most_frames_although_some_are_missing(server, tmp_path):
    times = [START + number * PERIOD for number in range(400) if not 100 < number < 300]
    messages = [("/camera", time, compressed(time, jpeg(grey(90)))) for time in times]
    ros2_log(tmp_path / "drive.mcap", messages, chunk_size=1 << 13)
    (far,) = roadeval.info(server.url("drive.mcap")).topics
    assert (far.count, far.rate_hz) == (len(times), 10)
    assert (far.first_ns, far.last_ns) == (times[0], times[-1])


def test_values_that_nobody_named_are_told_by_the_first_messages(server, tmp_path):
    masks = [np.arange(64 * 64, dtype=np.uint16).reshape(64, 64).astype(np.uint8)] * 40
    path = labelled(tmp_path / "drive.mcap", masks, chunk_size=1 << 13)
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (True, shown(path)[1])
    assert "name those that mean road" in far.problem


def test_of_several_cameras_the_choice_is_asked_for_by_the_summary(server, tmp_path):
    image = jpeg(grey(90))
    messages = [
        (topic, START + number * PERIOD, compressed(START + number * PERIOD, image))
        for number in range(40)
        for topic in ("/front/image", "/left/image")
    ]
    path = ros2_log(tmp_path / "drive.mcap", messages, chunk_size=1 << 13)
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (True, shown(path)[1])
    assert "2 image topics" in far.problem


def test_transforms_that_come_one_by_one_in_a_chunk_are_all_read(server, tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (256, 256, 3), dtype=np.uint8)
    png = cv2.imencode(".png", noise)[1].tobytes()
    kinds = {"/tf_static": "tf2_msgs/msg/TFMessage", "/front/info": "sensor_msgs/msg/CameraInfo"}
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = Ros2Writer(file, chunk_size=4 << 20, compression=CompressionType.NONE)
        schemas = {name: writer.register_msgdef(name, text) for name, text in MESSAGES.items()}

        def write(topic, message, time):
            kind = kinds.get(topic, "sensor_msgs/msg/CompressedImage")
            writer.write_message(topic, schemas[kind], message, log_time=time)

        write("/front/info", info(size=(256, 256)), START)
        for number in range(30):
            time = START + number * PERIOD
            picture = compressed(time, png, "png")
            write(
                "/front/image", picture | {"header": picture["header"] | {"frame_id": "cam"}}, time
            )
            if number in (0, 3):
                write("/tf_static", transforms(TREE[number // 3 :][:1]), time)
        writer.finish()
    far, lines = shown(server.url("drive.mcap"))
    assert (far.by_summary, lines) == (True, shown(tmp_path / "drive.mcap")[1])
    assert "mounted in base_link" in " ".join(lines)


def test_labels_beside_a_far_log_are_held_against_all_its_frames(server, tmp_path):
    demo_log(tmp_path / "drive.mcap", chunk_size=1 << 14)
    config = LogConfig(truth=LabelPlace(path=f"{DEMO}:/truth/road"))
    far, lines = shown(server.url("drive.mcap"), config=config)
    assert (far.by_summary, far.problem) == (False, "")
    assert lines == shown(tmp_path / "drive.mcap", config=config)[1]
