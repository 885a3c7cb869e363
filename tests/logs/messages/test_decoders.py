"""Messages in every encoding: pictures and their pixels, calibrations and transforms."""

import json
import re
import struct
from collections.abc import Collection
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import flatbuffers
import numpy as np
import pytest
import zstandard
from foxglove_schemas_flatbuffer import CameraCalibration, FrameTransform, Quaternion, Vector3
from mcap.records import Channel, Schema
from mcap_ros2._dynamic import serialize_dynamic

from benchmarks.long_logs import MESSAGES
from roadeval.images.formats import Limits
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.log import open_log
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    Picture,
    RawPicture,
    Video,
    codec_of,
    decoder_for,
    is_keyframe,
    message_stamp,
)
from roadeval.logs.messages.pixels import to_labels, to_rgb
from roadeval.logs.settings import FrameSettings, LabelPlace, LabelSettings, LogConfig
from tests.fixtures.flavours import ENCODERS, VIDEO_FRAMES, bar, packets
from tests.fixtures.shared import both
from tests.logs.making import COMPRESSED, PERIOD, START, compressed, frames, png, ros2_log

STAMP = 1_700_000_000_123_456_789
NAME = "sensor_msgs/msg/CompressedImage"


def channel(encoding: str) -> Channel:
    return Channel(id=1, topic="/cam", message_encoding=encoding, metadata={}, schema_id=1)


def schema(name: str, encoding: str, text: str = "") -> Schema:
    return Schema(id=1, name=name, encoding=encoding, data=text.encode())


def read(encoding: str, described: Schema | None, data: bytes) -> Picture:
    return decoder_for(channel(encoding), described).picture(data)


PACKED = serialize_dynamic(NAME, COMPRESSED)[NAME](compressed(STAMP, b"file"))
BIG_ENDIAN = bytes(4) + struct.pack(
    ">III4sI5sxxxI4s", *divmod(STAMP, 10**9), 4, b"cam\0", 5, b"jpeg\0", 4, b"file"
)


@pytest.mark.parametrize(
    ("described", "data"),
    [
        (schema(NAME, "ros2msg", "uint3 nonsense"), PACKED),
        (schema(NAME, "omgidl", "module ..."), PACKED),
        (schema(NAME, ""), BIG_ENDIAN),
        (schema(NAME, "ros2msg", COMPRESSED), zstandard.compress(PACKED)),
    ],
    ids=["a schema that makes no sense", "omgidl", "big endian", "compressed by rosbag2"],
)
def test_cdr_is_read_as_writers_leave_it(described: Schema, data: bytes) -> None:
    picture = read("cdr", described, data)
    assert isinstance(picture, CompressedPicture)
    assert (picture.stamp_ns, picture.format, bytes(picture.data)) == (STAMP, "jpeg", b"file")


@pytest.mark.parametrize(
    "fields",
    [
        {"timestamp": {"sec": 5, "nsec": 6}},
        {"timestamp": {"seconds": 5, "nanos": 6}},
        {"timestamp": "1970-01-01T00:00:05.000000006Z"},
        {"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "cam"}},
        {"header": {"stamp": {"secs": 5, "nsecs": 6}, "frame_id": "cam"}},
    ],
)
def test_json_is_read_with_every_form_of_a_stamp(fields: dict[str, Any]) -> None:
    message = fields | {"format": "jpeg", "data": "ZmlsZQ=="}
    picture = read("json", None, json.dumps(message).encode())
    assert isinstance(picture, CompressedPicture)
    decoded = picture.stamp_ns, picture.format, bytes(picture.data)
    assert decoded == (5_000_000_006, "jpeg", b"file")


@pytest.mark.parametrize(
    ("encoding", "described", "data"),
    [
        # A damaged schema may make a number of the format's name.
        ("json", None, b'{"format": null, "data": "ZmlsZQ=="}'),
        ("json", None, b'{"format": 1.5, "data": "ZmlsZQ=="}'),
        ("json", None, b'{"format": ["jpeg"], "data": "ZmlsZQ=="}'),
        ("json", None, b'{"x": 1}'),
        ("json", None, b"{"),
        ("json", None, b'{"format": "jpeg", "data": "?"}'),
        ("json", None, b'{"format": "jpeg", "data": 4000000000}'),
        ("cdr", schema(NAME, ""), b"\x00\x01\x00"),
        ("cdr", schema(NAME, ""), PACKED[:-2]),
        ("flatbuffer", schema("foxglove.CompressedImage", "flatbuffer"), b"\x10\x00\x00\x00abc"),
        ("protobuf", schema("foxglove.CompressedImage", "protobuf", "?"), b""),
        ("cbor", schema("foxglove.CompressedImage", ""), b""),
    ],
)
def test_what_cannot_be_read_is_refused(encoding, described, data):
    with pytest.raises(BadMessage):
        read(encoding, described, data)


@pytest.mark.parametrize(
    ("data", "is_whole"), [(PACKED, True), (PACKED[:-1], False), (PACKED + b"more", False)]
)
def test_a_message_is_as_long_as_its_fields_say(data: bytes, is_whole: bool) -> None:
    message = Message(1, 0, 0, 0, memoryview(data))
    described = schema(NAME, "ros2msg", COMPRESSED)
    assert (message_stamp(channel("cdr"), described, message) is not None) is is_whole


D, K = [-0.1, 0.01, 0.0, 0.0, 0.5], [80.0, 0, 48, 0, 81, 36, 0, 0, 1]
P = [70.0, 0, 47, 0, 0, 71, 35, 0, 0, 0, 1, 0]
TIME: list[Any] = [5, 7]
INFO = [*TIME, "cam", 72, 96, "plumb_bob", 5, *D, *K, *K, *P, 2, 3, 1, 2, 30, 40, True]
TRANSFORM = [1, *TIME, "base_link", "cam", 1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]
TEXT = MESSAGES["sensor_msgs/msg/CameraInfo"]
UPPER = re.sub(r"(?<=\] )[dkrp]$", lambda name: name[0].upper(), TEXT, flags=re.MULTILINE)
"""The text with D, K, R and P, as rosbags-convert 0.11.9 writes it."""


def packed(values: list[Any], kind: int = 1, *, ros1: bool = False) -> bytes:
    """Return the bytes of a message; ``kind`` is the encapsulation's number."""
    order, widest = "<" if kind & 1 else ">", 4 if kind >= 6 else 8
    data = b""

    def add(code: str, value: Any) -> None:
        nonlocal data
        width = struct.calcsize(code)
        data += b"" if ros1 else bytes(-len(data) % min(width, widest))
        data += struct.pack(order + code, value)

    for value in values:
        if isinstance(value, str):
            text = value.encode() + (b"" if ros1 else b"\0")
            add("I", len(text))
            data += text
        else:
            add({bool: "?", int: "I", float: "d"}[type(value)], value)
    head = b"" if ros1 else bytes([0, kind, 0, 0])
    return head + (struct.pack("<I", len(data)) if kind == 9 else b"") + data


def numbers(values: list[Any]) -> list[Any]:
    """Return all of a message's own numbers as floats where they are so in a message."""
    lens = values.index("plumb_bob") + 2
    return [*values[:lens], *map(float, values[lens : lens + 35]), *values[lens + 35 :]]


def fields(encoding: str, name: str, text: tuple[str, str], data: bytes) -> Any:
    return decoder_for(channel(encoding), schema(name, *text)).fields(data)


@pytest.mark.parametrize("text", [("ros2msg", UPPER), ("", ""), ("omgidl", "module x {}")])
@pytest.mark.parametrize("kind", [0, 1, 7, 9])
def test_a_camera_info_is_read_whatever_its_schema_says(text: tuple[str, str], kind: int):
    """rosbags-convert 0.11.9 writes D, K, R and P, names that mcap-ros2-support 0.5.5 refuses."""
    message = fields("cdr", "sensor_msgs/msg/CameraInfo", text, packed(numbers(INFO), kind))
    assert (message.header.frame_id, message.width, message.height) == ("cam", 96, 72)
    assert (message.distortion_model, message.d, message.k, message.p) == ("plumb_bob", D, K, P)
    assert (message.binning_x, message.binning_y) == (2, 3)
    assert (message.roi.x_offset, message.roi.y_offset) == (1, 2)
    assert (message.roi.width, message.roi.height) == (40, 30)


def test_a_camera_info_of_ros_1_is_read_without_a_text():
    data = packed([1, *numbers(INFO)], ros1=True)
    message = fields("ros1", "sensor_msgs/CameraInfo", ("", ""), data)
    assert (message.width, message.d, message.k, message.binning_y) == (96, D, K, 3)


@pytest.mark.parametrize("kind", [0, 1, 7])
def test_transforms_are_read_without_a_text(kind: int):
    message = fields("cdr", "tf2_msgs/msg/TFMessage", ("", ""), packed(TRANSFORM, kind))
    (frame,) = message.transforms
    assert (frame.header.frame_id, frame.child_frame_id) == ("base_link", "cam")
    assert (frame.transform.translation.z, frame.transform.rotation.w) == (3.0, 0.8)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("sensor_msgs/msg/CameraInfo", packed(numbers(INFO))[:-9]),
        ("sensor_msgs/msg/CameraInfo", packed(numbers(INFO))[:-1]),
        ("sensor_msgs/msg/CameraInfo", packed(numbers(INFO)) + bytes(9)),
        ("tf2_msgs/msg/TFMessage", packed([2**32 - 1, *TRANSFORM[1:]])),
    ],
)
def test_a_message_of_another_length_or_a_number_that_cannot_be_is_refused(name, data):
    with pytest.raises(BadMessage):
        fields("cdr", name, ("", ""), data)


def made(builder: flatbuffers.Builder, table: Any, **parts: Any) -> int:
    """Write a table of FlatBuffers."""
    table.Start(builder)
    for name, value in parts.items():
        getattr(table, f"Add{name}")(builder, value)
    return table.End(builder)


def test_foxgloves_flatbuffers_are_read():
    builder = flatbuffers.Builder()
    numbers = zip("DKP", (D, K, P), strict=True)
    parts = {name: builder.CreateNumpyVector(np.array(values)) for name, values in numbers}
    parts |= {"DistortionModel": builder.CreateString("plumb_bob")}
    parts |= {"FrameId": builder.CreateString("cam"), "Width": 96}
    builder.Finish(made(builder, CameraCalibration, **parts))
    text = "flatbuffer", ""
    message = fields("flatbuffer", "foxglove.CameraCalibration", text, bytes(builder.Output()))
    assert (message.frame_id, message.width, message.d, message.k, message.p) == (
        "cam",
        96,
        D,
        K,
        P,
    )

    builder = flatbuffers.Builder()
    parent = builder.CreateString("base_link")
    at, turn = made(builder, Vector3, Z=3.0), made(builder, Quaternion, W=0.8)
    parts = {"ParentFrameId": parent, "Translation": at, "Rotation": turn}
    builder.Finish(made(builder, FrameTransform, **parts))
    message = fields("flatbuffer", "foxglove.FrameTransform", text, bytes(builder.Output()))
    assert (message.parent_frame_id, message.translation.z, message.rotation.w) == (
        "base_link",
        3.0,
        0.8,
    )


LIMITS = Limits()


def picture(data: bytes, encoding: str, width: int, height: int = 1, step: int = 0) -> RawPicture:
    return RawPicture(0, width, height, encoding, step, False, data)


def test_floats_count_from_zero_to_one_and_nan_is_black() -> None:
    data = np.array([0, 0.5, 1, 2, np.nan], np.float32).tobytes()
    pixels = to_rgb(picture(data, "32FC1", 5), LIMITS)
    assert pixels[0, :, 0].tolist() == [0, 128, 255, 255, 0]


def test_labels_keep_sixteen_bits() -> None:
    assert to_labels(picture(b"\x2c\x01", "16UC1", 1), LIMITS).tolist() == [[300]]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (picture(b"\x01", "mono8", 2), "1 bytes of pixels where 2 are needed"),
        (picture(b"", "mono8", 0), "an image of 0x1"),
        (picture(b"\x01\x02", "mono8", 2, step=1), "with 1 bytes a row"),
        (picture(b"\x01", "mono8", 2**31, 2**31), "an image of"),
        (picture(b"\x01", "h8s2", 1), "encoding 'h8s2' is unknown"),
    ],
)
def test_what_cannot_be_is_refused(bad: RawPicture, reason: str) -> None:
    with pytest.raises(BadMessage, match=reason):
        to_rgb(bad, LIMITS)


# --- Video in a log: frames that need the frames before them --------------------------------------


H264 = "fox_pb_CompressedVideo_h264.mcap"
VIDEOS = both("flavours", H264, "fox_pb_CompressedVideo_vp9.mcap")
of_h264 = pytest.mark.parametrize("log", both("flavours", H264), indirect=True)


@pytest.mark.parametrize("log", VIDEOS, indirect=True)
def test_its_size_is_known_before_the_first_frame(log: Path) -> None:
    with open_log(log) as opened:
        assert opened.topics[0].kind is TopicKind.VIDEO
        assert opened.topics[0].size in ((128, 96), (320, 240))
        assert opened.topics[0].size == frames(log)[0].image.shape[1::-1]


@pytest.mark.parametrize("log", VIDEOS, indirect=True)
def test_a_start_amid_the_video_begins_at_the_keyframe_before(log, monkeypatch):
    all_frames = frames(log)
    monkeypatch.setattr("roadeval.logs.messages.pictures.PATIENCE", 2)
    with open_log(log) as opened:
        stream = opened.frames(opened.select())
        start = [frame.log_time_ns for frame in stream][7]
    late = frames(log, start=f"{start}ns")
    assert [frame.number for frame in late] == [7, 8, 9, 10, 11]
    assert np.array_equal(late[0].image, all_frames[7].image)


class Packets(list[CompressedPicture]):
    """The packets of a video, some of which cannot be read."""

    lost: Collection[int] = ()

    def picture(self, position: int) -> CompressedPicture:
        if position in self.lost:
            raise FrameError("a chunk whose checksum is wrong")
        return self[position]


def packets_of(path: Path, *lost: int) -> Packets:
    """Return the packets of a log, some of them lost."""
    with open_log(path) as log:
        stream = log.frames(log.select())
        packets = Packets(CompressedPicture(f.stamp_ns, "h264", f.decode().payload) for f in stream)
    packets.lost = lost
    return packets


def readable(packets: Packets) -> list[int]:
    video, positions = Video(packets, Limits()), []
    for position in range(len(packets)):
        with suppress(FrameError):
            video.picture(position)
            positions.append(position)
    return positions


@of_h264
def test_frames_that_build_upon_a_lost_one_are_lost_until_the_next_keyframe(log: Path) -> None:
    keyframes = [i for i, packet in enumerate(packets_of(log)) if is_keyframe(packet)]
    assert keyframes[0] == 0
    resumed = next((frame for frame in keyframes if frame > 3), 12)
    assert readable(packets_of(log)) == list(range(12))
    assert readable(packets_of(log, 3)) == [0, 1, 2, *range(resumed, 12)]


@of_h264
def test_a_video_without_its_keyframe_is_not_guessed_at(log: Path) -> None:
    with pytest.raises(FrameError, match=r"keyframe|builds upon"):
        Video(packets_of(log, 0), Limits()).picture(1)


def numbered(codec: str, *, counted: bool) -> Packets:
    """Return the packets of a video, whose stamps are their numbers."""
    data = enumerate(packets(codec))
    return Packets(CompressedPicture(n, codec, it, "", n if counted else None) for n, it in data)


@pytest.mark.parametrize("lost", range(VIDEO_FRAMES))
@pytest.mark.parametrize(
    ("codec", "counted"),
    [("h264", False), ("h264", True), ("vp9", True), ("h265", True), ("av1", True)],
)
def test_what_builds_upon_a_packet_that_is_missing_is_lost(codec, counted, lost):
    """FFmpeg 7 conceals a missing reference of H.264 and VP9, and raises and flags nothing."""
    left = numbered(codec, counted=counted)
    keys = (n for n in range(lost + 1, VIDEO_FRAMES) if is_keyframe(left[n]))
    resumed = next(keys, VIDEO_FRAMES)
    del left[lost]
    stamps = [left[position].stamp_ns for position in readable(left)]
    assert stamps == [*range(lost), *range(resumed, VIDEO_FRAMES)]


@pytest.mark.parametrize("codec", ["h264", "h265", "vp9"])
def test_an_empty_packet_ends_no_decoder(codec):
    """Encoders that leave a frame out write such packets; VP9 does not show whether one is lost."""
    video = numbered(codec, counted=False)
    video.insert(6, CompressedPicture(99, codec, b""))
    keys = [n for n in range(6, len(video)) if is_keyframe(video[n])]
    resumed = keys[0] if codec == "vp9" else 7
    assert readable(video) == [*range(6), *range(resumed, VIDEO_FRAMES + 1)]
    with pytest.raises(FrameError, match="a packet without data"):
        Video(video, Limits()).picture(6)


@pytest.mark.parametrize("encoder", ["av1", "libsvtav1", "librav1e", "libaom-av1", "av1_nvenc"])
def test_a_packet_may_name_its_encoder(encoder):
    assert codec_of(CompressedPicture(0, encoder, b"")) == "av1"


CODECS = [f"made:flavours/fox_pb_CompressedVideo_{codec}.mcap" for codec in ENCODERS]


@pytest.mark.parametrize("log", CODECS, indirect=True)
def test_every_codec_is_decoded_from_any_frame(log: Path) -> None:
    all_frames = frames(log)
    late = frames(log, start=f"{all_frames[6].log_time_ns}ns")
    assert [frame.number for frame in all_frames] == list(range(VIDEO_FRAMES))
    assert all(np.abs(f.image.astype(int) - bar(f.number)).mean() < 5 for f in all_frames)
    assert all(np.array_equal(a.image, b.image) for a, b in zip(late, all_frames[6:], strict=True))


@of_h264
def test_parameters_in_a_packet_of_their_own_announce_a_keyframe(log: Path) -> None:
    keyframe = bytes(packets_of(log)[0].data)
    parameters = keyframe[: keyframe.index(b"\x00\x00\x01\x65")]
    assert is_keyframe(CompressedPicture(0, "h264", parameters))
    assert not is_keyframe(CompressedPicture(0, "h264", b"no video"))


def damaged_at(log: Path, number: int) -> Packets:
    """Return the packets of a log, the second half of one of them with wrong bytes."""
    packets = packets_of(log)
    data = bytes(packets[number].data)
    half = len(data) // 2
    data = data[:half] + b"U" * (len(data) - half)
    packets[number] = CompressedPicture(number, "h264", data)
    return packets


@of_h264
def test_a_damaged_frame_and_those_that_build_upon_it_are_told(log: Path) -> None:
    video = Video(damaged_at(log, 2), Limits())
    assert all(video.picture(number).pixels.any() for number in range(2))
    with pytest.raises(FrameError, match="its video is damaged"):
        video.picture(2)
    with pytest.raises(FrameError, match="a frame that it builds upon is damaged"):
        video.picture(3)


@pytest.mark.parametrize("log", CODECS, indirect=True)
def test_a_video_of_too_many_pixels_is_not_decoded(log: Path) -> None:
    too_large = r"more than the 1000 pixels that `frames.max_pixels` allows"
    with (
        open_log(log, LogConfig(frames=FrameSettings(max_pixels=1000))) as opened,
        pytest.raises(FrameError, match=too_large),
    ):
        next(opened.frames(opened.select())).decode()


def encoded(pictures: list[np.ndarray], bf: int, more: str = "") -> list[tuple[int, bytes]]:
    """Encode planes of luma nearly without loss, ``bf`` B-frames in a row: places and packets."""
    import av

    encoder = av.CodecContext.create("libx264", "w")
    encoder.height, encoder.width = pictures[0].shape
    encoder.pix_fmt, encoder.framerate, encoder.time_base = "yuv420p", 10, Fraction(1, 10)
    encoder.max_b_frames = bf
    encoder.options = {"x264-params": f"qp=1:scenecut=0:b-adapt=0{more}"}
    packets = []
    for number, luma in enumerate(pictures):
        grey = np.full((luma.shape[0] // 2, luma.shape[1]), 128, np.uint8)
        frame = av.VideoFrame.from_ndarray(np.concatenate([luma, grey]), "yuv420p")
        frame.pts = number
        packets += encoder.encode(frame)
    return [(int(packet.pts), bytes(packet)) for packet in (*packets, *encoder.encode(None))]


def stamped(video: list[tuple[int, bytes]], *, by_place: bool = True) -> Packets:
    """Return packets with stamps: by their places, or in the order of the packets."""
    return Packets(
        CompressedPicture(100 + (place if by_place else order), "h264", data)
        for order, (place, data) in enumerate(video)
    )


@pytest.mark.parametrize(
    ("bf", "by_place", "note"),
    [
        (0, True, None),
        (2, True, "the video has B-frames: frames are numbered in the order of decoding"),
        (2, False, "the video has B-frames, and stamps in the order of decoding"),
    ],
)
def test_b_frames_are_told(bf: int, by_place: bool, note: str | None) -> None:
    slope = np.arange(64, dtype=np.uint8) + 60
    pictures = [np.roll(slope, 5 * i)[None].repeat(48, 0) for i in range(9)]
    packets = stamped(encoded(pictures, bf), by_place=by_place)
    video = Video(packets, Limits())
    for position in range(len(packets)):
        video.picture(position)
    assert video.notes.get("order", "")[: len(note or "")] == (note or "")
    assert bool(video.notes) == bool(note)


def test_labels_with_numbers_are_those_of_b_frames_as_they_are_shown(tmp_path: Path) -> None:
    pictures = [np.full((48, 64), 20 + 20 * i, np.uint8) for i in range(10)]
    video = encoded(pictures, 2)
    messages = [
        ("/camera", 1000 + at, compressed(1000 + 100 * place, data, "h264"))
        for at, (place, data) in enumerate(video)
    ]
    (tmp_path / "labels").mkdir()
    for number in range(10):
        label = np.full((48, 64), number, np.uint8)
        (tmp_path / "labels" / f"{number:03d}.png").write_bytes(png(label))
    path = ros2_log(tmp_path / "a.mcap", messages)
    labels = LabelSettings(road=(0,))
    config = LogConfig(truth=LabelPlace(str(tmp_path / "labels"), first=0), labels=labels)
    with open_log(path, config) as log:
        by_number = {frame.number: frame for frame in log.frames(log.select())}
        numbers = [Path(by_number[n].labels["/truth"].place).stem for n in range(10)]
    assert [int(number) for number in numbers] == [place for place, _ in video]


KEYED = ":keyint=10:min-keyint=10"
PATTERN = np.random.default_rng(0).integers(40, 200, (6, 40), np.uint8).repeat(8, 0).repeat(8, 1)
MOVING = [np.ascontiguousarray(PATTERN[:, 6 * n : 6 * n + 64]) for n in range(40)]


def without_parameters(data: bytes) -> bytes:
    """Return a packet of H.264 without its parameters."""
    return re.sub(rb"\x00\x00\x01[\x67\x68].*?(?=\x00\x00\x01|\Z)", b"", data, flags=re.DOTALL)


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize(
    ("bf", "more"),
    [
        pytest.param(0, KEYED, marks=pytest.mark.sweep),
        (3, KEYED),
        (3, KEYED + ":open-gop=1"),
        (0, KEYED + ":intra-refresh=1"),
    ],
)
def test_a_frame_does_not_depend_on_where_reading_begins(bf: int, more: str, once: bool) -> None:
    video = encoded(MOVING, bf, more)
    if once:
        video[1:] = [(place, without_parameters(data)) for place, data in video[1:]]
    packets = stamped(video)
    in_order = Video(packets, Limits())
    for position, (place, _) in enumerate(video):
        for reading in (in_order, Video(packets, Limits())):
            luma = reading.picture(position).pixels[..., 1]
            shown = np.clip((MOVING[place].astype(int) - 16) * 255 / 219, 0, 255)
            assert np.abs(luma - shown).mean() < 5


def parted(codec: str, data: bytes) -> list[bytes]:
    """Return a packet of a video with its parameters in packets of their own."""
    units = [b"\0\0\1" + unit for unit in re.split(rb"\x00*\x00\x00\x01", data)[1:]]
    heads = b"\x67\x68" if codec == "h264" else b"\x40\x42\x44"
    alone = [unit for unit in units if unit[3] in heads]
    return [*alone, b"".join(unit for unit in units if unit not in alone)]


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_packets_of_parameters_alone_are_no_frames_and_take_no_label(codec, tmp_path):
    messages, at = [], 0
    for number, data in enumerate(packets(codec)):
        stamp = START + number * PERIOD
        for part in parted(codec, data):
            messages.append(("/camera", START + at * PERIOD, compressed(stamp, part, codec)))
            at += 1
        mask = np.full(bar(0).shape[:2], 255, np.uint8)
        messages.append(("/labels", START + at * PERIOD - 1, compressed(stamp, png(mask), "png")))
    assert at > VIDEO_FRAMES + 5
    with open_log(ros2_log(tmp_path / "a.mcap", messages)) as log:
        stream = log.frames(log.select())
        frames_read = [frame.decode() for frame in stream]
        assert log.losses == stream.accounting.losses == ()
        (count,) = (topic.count for topic in log.topics if topic.name == "/camera")
    assert [frame.number for frame in frames_read] == list(range(VIDEO_FRAMES)) == [*range(count)]
    assert [(f.stamp_ns - START) // PERIOD for f in frames_read] == list(range(VIDEO_FRAMES))
    assert all(np.abs(f.image.astype(int) - bar(f.number)).mean() < 5 for f in frames_read)
    assert all(frame.truth is not None for frame in frames_read)


@pytest.mark.parametrize("lost", range(1, 30))
def test_frames_of_an_open_group_are_not_built_upon_a_lost_frame(lost: int) -> None:
    video = encoded(MOVING, 3, KEYED + ":open-gop=1")
    packets, frames_read = stamped(video), 0
    packets.lost = [lost]
    reading = Video(packets, Limits())
    for position, (place, _) in enumerate(video):
        with suppress(FrameError):
            luma, frames_read = reading.picture(position).pixels[..., 1], frames_read + 1
            shown = np.clip((MOVING[place].astype(int) - 16) * 255 / 219, 0, 255)
            assert np.abs(luma - shown).mean() < 5
    assert frames_read >= 25


def test_the_size_of_a_video_that_begins_between_keyframes(tmp_path: Path) -> None:
    video = encoded(MOVING, 0, KEYED)[4:]
    messages = [("/camera", at, compressed(at, data, "h264")) for at, (_, data) in enumerate(video)]
    with open_log(ros2_log(tmp_path / "a.mcap", messages)) as log:
        assert log.topics[0].size == (64, 48)


@pytest.mark.parametrize("full_range", [False, True])
def test_luma_beyond_its_range_is_told_and_read_as_asked(full_range: bool) -> None:
    levels = np.repeat(np.array([16, 64, 128, 192, 240, 250], np.uint8), 16)
    packets = stamped(encoded([levels[None].repeat(48, 0)] * 3, 0))
    video = Video(packets, Limits(full_range=full_range))
    grey = video.picture(0).pixels[24, 8::16, 0].astype(int)
    expected = levels[8::16] if full_range else [0, 56, 130, 205, 255, 255]
    assert np.abs(grey - expected).max() < 3
    assert (video.notes.get("range") is None) == full_range
