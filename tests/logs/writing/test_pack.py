"""Folders of images and videos become logs, and results are written back to MCAP."""

import errno
import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_ros2._dynamic import serialize_dynamic

from roadeval.data import (
    ERRORS,
    Counts,
    Frame,
    FrameResult,
    Layer,
    Output,
    Packed,
    Role,
    StageResult,
    Tally,
    VariantResult,
)
from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelSettings, LogConfig
from roadeval.logs.writing.writer import LogWriter, SidecarWriter, pack
from tests.fixtures.make import make
from tests.fixtures.shared import shared
from tests.logs.making import COMPRESSED, SECOND, compressed, grey, jpeg, png, ros2_log
from tests.logs.messages.test_decoders import KEYED, MOVING, encoded, parted, without_parameters

HALF_SECOND = 500_000_000


def folder(path: Path, files: dict[str, bytes]) -> Path:
    path.mkdir()
    for name, data in files.items():
        (path / name).write_bytes(data)
    return path


def frames_of(path: Path, **settings: Any) -> list[Frame]:
    with open_log(path, LogConfig(**settings)) as log:
        return [frame.decode() for frame in log.frames(log.select())]


def test_images_go_in_as_they_are_in_natural_order(tmp_path: Path) -> None:
    files = {f"{i}.jpg": jpeg(grey(20 * i)) for i in (10, 9, 2)}
    packed = pack(folder(tmp_path / "images", files), tmp_path / "a.mcap", rate_hz=2)
    frames = frames_of(packed.path)
    assert [bytes(frame.payload) for frame in frames] == [files[f"{i}.jpg"] for i in (2, 9, 10)]
    assert [frame.stamp_ns for frame in frames] == [0, HALF_SECOND, 2 * HALF_SECOND]


def test_masks_belong_to_the_image_of_their_name(tmp_path: Path) -> None:
    images = folder(tmp_path / "images", {f"{name}.jpg": jpeg(grey(9)) for name in "abc"})
    masks = {"a.png": png(grey(255)), "b_mask.png": png(grey(0)), "x.png": png(grey(1))}
    packed = pack(images, tmp_path / "a.mcap", masks=folder(tmp_path / "masks", masks))
    assert (packed.frames, packed.labelled) == (3, 2)
    assert packed.warnings == (
        "images without a mask: c.jpg (1 in all)",
        "masks without an image: x.png (1 in all)",
    )
    truths = [frame.truth for frame in frames_of(packed.path)]
    assert [None if truth is None else int(truth[0, 0]) for truth in truths] == [1, 0, None]


def test_times_in_names_become_stamps(tmp_path: Path) -> None:
    names = ("1700000000.25", "1700000000.5")
    images = folder(tmp_path / "images", {f"{name}.jpg": jpeg(grey(9)) for name in names})
    packed = pack(images, tmp_path / "a.mcap")
    assert packed.stamps == "the times in the files' names"
    assert [frame.stamp_ns for frame in frames_of(packed.path)] == [
        1_700_000_000_250_000_000,
        1_700_000_000_500_000_000,
    ]


BMP = cv2.imencode(".bmp", np.arange(48, dtype=np.uint8).reshape(4, 4, 3))[1].tobytes()


@pytest.mark.parametrize(
    ("image", "masks", "rate_hz", "reason"),
    [
        ({"a.bmp": BMP}, None, None, r"a\.bmp: BMP, .*: save it as PNG"),
        ({"a.jpg": jpeg(grey(9))}, {"a.jpg": jpeg(grey(9))}, None, "JPEG changes label values"),
        ({"a.jpg": jpeg(grey(9))}, {"x.png": png(grey(9))}, None, "no mask has the name of an im"),
        ({"a.jpg": jpeg(grey(9))}, {"b.txt": b""}, None, "no image in it"),
        ({"a.jpg": jpeg(grey(9))}, None, 0, "0 images a second"),
        (None, None, None, "neither a folder of images nor a video"),
    ],
)
def test_what_cannot_be_packed_is_refused(
    tmp_path: Path, image: Any, masks: Any, rate_hz: float | None, reason: str
) -> None:
    images = folder(tmp_path / "images", image) if image else tmp_path / "missing"
    labels = folder(tmp_path / "masks", masks) if masks else None
    with pytest.raises(LogError, match=reason):
        pack(images, tmp_path / "a.mcap", masks=labels, rate_hz=rate_hz)
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no image", "a.png: 8 bytes that are not an image of a known format"),
        (b"", "a.png: 0 bytes"),
        (png(grey(9))[:20], "a.png: a damaged PNG"),
    ],
)
def test_an_image_file_that_is_none_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    good = folder(tmp_path / "images", {"a.png": png(grey(9))})
    bad = folder(tmp_path / "bad", {"a.png": content})
    with pytest.raises(LogError, match=message):
        pack(bad, tmp_path / "a.mcap")
    with pytest.raises(LogError, match=message):
        pack(good, tmp_path / "a.mcap", masks=bad)
    assert not (tmp_path / "a.mcap").exists()


ROAD, MARKING, OWN_CAR, VERGE = (64, 32, 32), (255, 0, 0), (204, 0, 255), (128, 128, 96)


@pytest.fixture(params=["made", *shared("comma10k_mini")], ids=str)
def painted(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Folders of images and of masks whose colours say what is what."""
    if request.param != "made":
        return request.param  # type: ignore[no-any-return]
    mask = np.full((6, 8, 3), VERGE, np.uint8)
    mask[2:4], mask[3, 4], mask[4:] = ROAD, MARKING, OWN_CAR
    names = [f"{number:04}" for number in range(11)]
    folder(tmp_path / "imgs", {f"{name}.png": png(grey(100)) for name in names})
    folder(tmp_path / "masks", {f"{name}.png": png(mask[..., ::-1]) for name in names})
    return tmp_path


def test_images_and_colour_masks_of_the_road(painted: Path, tmp_path: Path) -> None:
    packed = pack(painted / "imgs", tmp_path / "comma.mcap", masks=painted / "masks")
    labels = LabelSettings(road_colors=(ROAD, MARKING), ignore_colors=(OWN_CAR,))
    with pytest.raises(LogError, match=r"/truth/road.*`labels\.road_colors`"):
        frames_of(packed.path)
    frames = frames_of(packed.path, labels=labels)
    first = cv2.imread(str(min((painted / "masks").glob("*.png"))))[..., ::-1]
    road = (first == ROAD).all(2) | (first == MARKING).all(2)
    assert len(frames) == 11
    assert frames[0].truth is not None
    assert np.array_equal(frames[0].truth == 1, road)


def film(path: Path, rate: int, count: int, *, noisy: bool = False) -> Path:
    """Write a video file; without noise the level of each frame is 8 times its number."""
    import av

    with av.open(str(path), "w") as container:
        try:
            stream = container.add_stream("libx264", rate=rate)
        except av.FFmpegError:
            pytest.skip("PyAV was built without libx264")
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.options = {"preset": "veryfast", "x264-params": "b-adapt=0"}
        for number in range(count):
            image = np.full((48, 64, 3), 8 * number, np.uint8)
            if noisy:
                image = np.random.default_rng(number).integers(256, size=image.shape).astype("u1")
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, "rgb24")))
        container.mux(stream.encode(None))
    return path


@pytest.fixture(params=["made", *shared("solidWhiteRight.mp4")], ids=str)
def video(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, int]:
    """A video of 25 frames a second, and how many it has."""
    if request.param == "made":
        return film(tmp_path / "film.mp4", 25, 20), 20
    return request.param, 221


def test_a_video_is_packed_frame_by_frame_and_read_by_foxgloves_decoder(
    video: tuple[Path, int], tmp_path: Path
) -> None:
    path, count = video
    packed = pack(path, tmp_path / "film.mcap")
    assert (packed.frames, packed.labelled) == (count, 0)
    with packed.path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        times = [m.timestamp.ToNanoseconds() for *_, m in reader.iter_decoded_messages()]
    assert times == [40_000_000 * i for i in range(count)]


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".mkv", ".ts", ".mpg"])
def test_frames_of_a_video_are_in_the_order_in_which_they_are_shown(tmp_path, suffix):
    """An AVI with B-frames has times in the order of decoding, an MPEG times of some frames."""
    packed = pack(film(tmp_path / f"film{suffix}", 25, 30), tmp_path / "film.mcap")
    with open_log(packed.path) as log:
        read = [frame.decode() for frame in log.frames(log.select())]
    levels = [frame.image.mean() for frame in read]
    np.testing.assert_allclose(levels, [8 * number for number in range(30)], atol=4)
    np.testing.assert_allclose([f.stamp_ns / 1e6 for f in read], np.arange(30) * 40, atol=1)


@pytest.mark.parametrize("suffix", [".mkv", ".avi", ".mp4"])
def test_of_a_video_that_was_cut_off_the_readable_frames_are_packed(tmp_path, suffix):
    path = film(tmp_path / f"film{suffix}", 25, 30, noisy=True)
    assert pack(path, tmp_path / "whole.mcap").losses == ()
    content = path.read_bytes()
    if suffix == ".mp4":  # its index stays at the end
        begin, end = len(content) // 2, len(content) * 3 // 5
        path.write_bytes(content[:begin] + bytes(end - begin) + content[end:])
    else:
        path.write_bytes(content[: len(content) * 3 // 5])
    packed = pack(path, tmp_path / "film.mcap")
    assert 10 < packed.frames < 30
    assert packed.losses[0].startswith(f"film{suffix}: ")
    assert len(frames_of(packed.path)) == packed.frames


@pytest.mark.parametrize(
    ("begin", "end", "told"),
    [(100.5, 10_000, "it ends within a packet"), (100, 103, "cannot be decoded")],
)
def test_a_transport_stream_that_lacks_bytes_is_packed_and_told(tmp_path, begin, end, told):
    path = film(tmp_path / "film.ts", 25, 30, noisy=True)
    assert pack(path, tmp_path / "whole.mcap").losses == ()
    content = path.read_bytes()
    path.write_bytes(content[: int(188 * begin)] + content[188 * end :])
    packed = pack(path, tmp_path / "film.mcap")
    assert 0 < packed.frames < 30
    assert told in packed.losses[0]


@pytest.mark.parametrize("labels", ["labels/a.json", "labels", "images"])
def test_labels_of_an_annotation_tool_are_said_to_be_for_a_replay(labels, tmp_path):
    for folder in ("images", "labels"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.json").write_text("{}")
    cv2.imwrite(str(tmp_path / "images" / "a.png"), np.zeros((4, 6, 3), np.uint8))
    images = tmp_path / "images"
    with pytest.raises(LogError) as caught:
        pack(images, tmp_path / "log.mcap", masks=tmp_path / labels)
    assert "\n" not in str(caught.value)
    command = f"roadeval replay LOG.mcap --truth {tmp_path / labels} --truth-images {images}"
    assert str(caught.value).endswith(command)
    assert not (tmp_path / "log.mcap").exists()


def written(path: Path) -> Path:
    with LogWriter(path) as log:
        for stamp in (10, 20):
            log.image("/camera", stamp, jpeg(grey(stamp)), "jpeg", log_time_ns=stamp + 1)
            log.mask("/truth/road", stamp, grey(255))
    return path


def test_foxgloves_own_decoder_reads_it(tmp_path: Path) -> None:
    with written(tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [
            (schema.name, channel.topic, decoded.timestamp.ToNanoseconds(), decoded.format)
            for schema, channel, _, decoded in reader.iter_decoded_messages()
        ]
    name = "foxglove.CompressedImage"
    assert sorted(found) == [
        (name, "/camera", 10, "jpeg"),
        (name, "/camera", 20, "jpeg"),
        (name, "/truth/road", 10, "png"),
        (name, "/truth/road", 20, "png"),
    ]


def test_nothing_is_left_of_a_log_that_cannot_be_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_writer: Writer) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, "finish", full)
    path = tmp_path / "a.mcap"
    with pytest.raises(LogError, match="cannot be written: No space left"):
        written(path)
    assert list(tmp_path.iterdir()) == []


MASK = np.array([[0, 1]], np.uint8)
RATES = {"ERR": 0.5, "TNR": math.nan}
STAMP, LOGGED = 1_700_000_000_000_000_005, 1_700_000_000_007_000_000


def result() -> FrameResult:
    frame = Frame(3, STAMP, LOGGED, np.zeros((1, 2, 3), np.uint8), b"")
    stage = StageResult("post", Output(mask=Packed.of(MASK)), 0.0)
    return FrameResult(
        frame,
        Role.EVALUATED,
        (VariantResult("filtered", (stage,)),),
        errors={"filtered": Layer(ERRORS, np.array([[2, 1]], np.uint8))},
        tallies=(Tally("filtered", "post", Counts(tp=1, fp=1), rates=RATES),),
    )


def write(path: Path, frame_id: str = "cam_front", camera: str = "") -> Path:
    with SidecarWriter(path) as sidecar:
        sidecar.write(result(), frame_id, camera)
    return path


def image(data: bytes) -> list[list[list[int]]]:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA)
    found: list[list[list[int]]] = pixels.tolist()
    return found


@pytest.mark.parametrize(("source", "kept"), [("cam_front", "cam_front"), ("", "camera")])
def test_masks_are_in_the_frame_of_the_camera(tmp_path: Path, source: str, kept: str) -> None:
    with write(tmp_path / "results.mcap", source, "/front").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = {
            channel.topic: message.frame_id
            for _, channel, _, message in reader.iter_decoded_messages(
                ["/roadeval/front/filtered/post", "/roadeval/front/filtered/errors"]
            )
        }
    assert found == {f"/roadeval/front/filtered/{name}": kept for name in ("post", "errors")}


def test_masks_and_errors_bear_the_images_own_times(tmp_path: Path) -> None:
    with write(tmp_path / "results.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = ["/roadeval/filtered/post", "/roadeval/filtered/errors"]
        found = {
            channel.topic: (message.log_time, decoded.timestamp.ToNanoseconds(), decoded.data)
            for _, channel, message, decoded in reader.iter_decoded_messages(topics)
        }
    assert {times[:2] for times in found.values()} == {(LOGGED, STAMP)}
    assert image(found[topics[0]][2]) == [[0, 255]]
    assert image(found[topics[1]][2]) == [[[213, 94, 0, 220], [0, 158, 115, 160]]]


def test_metrics_are_json_with_a_schema_and_undefined_rates_are_null(tmp_path: Path) -> None:
    with write(tmp_path / "results.mcap").open("rb") as file:
        messages = make_reader(file).iter_messages(["/roadeval/metrics/filtered/post"])
        ((schema, channel, message),) = messages
    assert schema is not None
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    fields = json.loads(message.data)
    properties = json.loads(schema.data)["properties"]
    assert set(properties) == set(fields)
    # Foxglove takes what has this title for a time.
    assert properties["timestamp"]["title"] == "time"
    assert fields["timestamp"] == {"sec": STAMP // 10**9, "nsec": 5}
    assert (fields["TP"], fields["FP"], fields["N"]) == (1, 1, 2)
    assert (fields["ERR"], fields["TNR"]) == (0.5, None)


# --- A part of a log: the messages of all topics of a span, as they were logged -------------------


TENTH = SECOND // 10


def write_drive(path, beginning=0, frames=100):
    """A camera at 10 Hz, labels a quarter of a second later, other topics, and what stands."""
    encode = serialize_dynamic("sensor_msgs/msg/CompressedImage", COMPRESSED)
    encode = encode["sensor_msgs/msg/CompressedImage"]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2000)
        writer.start("ros2", "test")
        picture = writer.register_schema(
            "sensor_msgs/msg/CompressedImage", "ros2msg", COMPRESSED.encode()
        )
        other = {
            name: writer.register_schema(name, "ros2msg", b"uint8 x\n")
            for name in ("tf2_msgs/msg/TFMessage", "sensor_msgs/msg/CameraInfo", "sensor_msgs/Imu")
        }
        transforms, info, imu = other.values()
        qos = {"offered_qos_profiles": "- durability: 1"}
        channels = {
            "/camera": writer.register_channel("/camera", "cdr", picture),
            "/labels": writer.register_channel("/labels", "cdr", picture),
            "/imu": writer.register_channel("/imu", "cdr", imu),
            "/bare": writer.register_channel("/bare", "json", 0),
            "/camera_info": writer.register_channel("/camera_info", "cdr", info),
            "/tf_static": writer.register_channel("/tf_static", "cdr", transforms, qos),
            "/tf": writer.register_channel("/tf", "cdr", transforms),
        }
        for number in range(beginning, beginning + frames):
            time = (number + 1) * TENTH
            data = encode(compressed(time, jpeg(grey(number))))
            messages = [("/camera", time, data), ("/labels", time + TENTH * 5 // 2, data)]
            messages += [("/imu", time + 3, b"imu"), ("/bare", time, b"{}"), ("/tf", time, b"tf")]
            messages += [("/camera_info", time, b"%d" % number)] if number % 50 == 0 else []
            messages += [("/tf_static", time, b"%d" % number)] if number in (0, 1) else []
            for topic, log_time, content in messages:
                writer.add_message(channels[topic], log_time, content, log_time - 1, number)
        writer.finish()
    return path


def messages_in(path):
    with path.open("rb") as file:
        return [
            (channel.topic, schema and schema.name, channel.metadata, message)
            for schema, channel, message in make_reader(file).iter_messages()
        ]


@pytest.fixture(params=["file", "split"])
def log(request, tmp_path):
    if request.param == "file":
        return write_drive(tmp_path / "drive.mcap")
    (tmp_path / "drive").mkdir()
    write_drive(tmp_path / "drive" / "drive_0.mcap", 0, 47)
    write_drive(tmp_path / "drive" / "drive_1.mcap", 47, 53)
    return tmp_path / "drive"


def test_an_excerpt_has_all_topics_from_two_seconds_before_to_the_last_frames_end(log, tmp_path):
    with open_log(log, every_topic=True) as opened:
        opened.write_excerpt("/camera", 40, 49, tmp_path / "part.mcap")
        assert opened.losses == ()
    messages = messages_in(tmp_path / "part.mcap")
    begin = 41 * TENTH - 2 * SECOND
    assert Counter(topic for topic, *_ in messages) == {
        "/camera": 30,
        "/labels": 30 + 2,  # two of them are logged after the end
        **dict.fromkeys(("/imu", "/bare", "/tf"), 30),
        "/camera_info": 1,
        "/tf_static": 2,
    }
    standing = {topic: m for topic, _, _, m in messages if topic in ("/camera_info", "/tf_static")}
    assert {m.log_time for m in standing.values()} == {begin}
    assert standing["/camera_info"].data == b"0"
    assert standing["/camera_info"].publish_time == TENTH - 1
    files = [log] if log.is_file() else [*log.iterdir()]
    before = {
        (t, s, str(q), m.publish_time, m.sequence, m.data)
        for f in files
        for t, s, q, m in messages_in(f)
    }
    after = {(t, s, str(q), m.publish_time, m.sequence, m.data) for t, s, q, m in messages}
    assert after < before
    times = [m.log_time for *_, m in messages]
    assert times == sorted(times)
    assert all(m.log_time in (m.publish_time + 1, begin) for *_, m in messages)


def test_where_all_stamps_are_equal_nothing_later_is_taken_for_a_label(tmp_path):
    images = [("/camera", at * TENTH, compressed(7, jpeg(grey(at)))) for at in range(50)]
    with open_log(ros2_log(tmp_path / "drive.mcap", images), every_topic=True) as log:
        log.write_excerpt("/camera", 24, 25, tmp_path / "part.mcap")
    assert [m.log_time // TENTH for *_, m in messages_in(tmp_path / "part.mcap")] == [*range(4, 26)]


def test_the_video_of_an_excerpt_begins_at_a_keyframe(tmp_path):
    """Every fourth frame is one; here the frames are a second apart."""
    with make("flavours/fox_pb_CompressedVideo_h264.mcap", tmp_path).open("rb") as file:
        messages = [*make_reader(file).iter_messages()]
    with (tmp_path / "slow.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema, channel, _ = messages[0]
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
        video = writer.register_channel(channel.topic, channel.message_encoding, number)
        for second, (*_, message) in enumerate(messages):
            writer.add_message(video, second * SECOND, message.data, message.publish_time)
        writer.finish()
    with open_log(tmp_path / "slow.mcap", every_topic=True) as log:
        log.write_excerpt(channel.topic, 7, 8, tmp_path / "part.mcap")
    assert len(messages_in(tmp_path / "part.mcap")) == 5
    with open_log(tmp_path / "part.mcap") as part:
        assert [frame.decode().number for frame in part.frames(part.select())] == [*range(5)]


@pytest.mark.parametrize("alone", [False, True])
def test_an_excerpt_has_the_parameters_of_a_video_that_were_sent_once(tmp_path, alone):
    video = encoded(MOVING, 0, KEYED)
    packets = [video[0][1], *(without_parameters(data) for _, data in video[1:])]
    messages = [
        ("/camera", SECOND, compressed(SECOND, part, "h264"))
        for part in (parted("h264", packets.pop(0)) if alone else [packets.pop(0)])
    ]
    messages += [
        ("/camera", at * SECOND, compressed(at * SECOND, data, "h264"))
        for at, data in enumerate(packets, 2)
    ]
    with open_log(ros2_log(tmp_path / "a.mcap", messages), every_topic=True) as log:
        log.write_excerpt("/camera", 25, 26, tmp_path / "part.mcap")
    with open_log(tmp_path / "part.mcap") as part:
        read = [frame.decode().stamp_ns // SECOND for frame in part.frames(part.select())]
    assert read == [1, *range(21, 28)]
