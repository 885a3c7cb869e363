"""Video in a log: frames that need the frames before them."""

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from mcap_protobuf.writer import Writer

from roadeval.data import Frame
from roadeval.logs import FrameError, Instant, LogError, Span, TopicKind, open_log
from roadeval.logs.messages.pictures import CompressedPicture, Picture
from roadeval.logs.messages.video import Video, is_keyframe

CODECS = ("fox_pb_CompressedVideo_h264", "fox_pb_CompressedVideo_vp9")


def frames(path: Path, span: Span | None = None) -> list[Frame]:
    with open_log(path) as log:
        return [frame.decode() for frame in log.frames(log.select(), span)]


@pytest.fixture(params=CODECS)
def video(data: Path, request: pytest.FixtureRequest) -> Path:
    return data / "mcap" / "flavours" / f"{request.param}.mcap"


def test_its_size_is_known_before_the_first_frame(video: Path) -> None:
    with open_log(video) as log:
        assert log.topics[0].kind is TopicKind.VIDEO
        assert log.topics[0].size == (320, 240)


def test_a_stride_gives_the_same_frames(video: Path) -> None:
    whole, some = frames(video), frames(video, Span(every=5))
    assert [frame.number for frame in some] == [0, 5, 10]
    assert all(np.array_equal(frame.image, whole[frame.number].image) for frame in some)


def test_a_start_amid_the_video_begins_at_the_keyframe_before(
    video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = frames(video)
    monkeypatch.setattr("roadeval.logs.messages.video.PATIENCE", 2)
    with open_log(video) as log:
        stream = log.frames(log.select())
        start = [frame.log_time_ns for frame in stream][7]
    late = frames(video, Span(Instant(start)))
    assert [frame.number for frame in late] == [7, 8, 9, 10, 11]
    assert np.array_equal(late[0].image, whole[7].image)


def test_one_stream_is_the_same_in_every_message(data: Path) -> None:
    folder = data / "mcap" / "flavours"
    names = ("fox_pb_CompressedVideo_h264", "ros2_CompressedImage_h264", "ros2_FFMPEGPacket_h264")
    first, *others = (frames(folder / f"{name}.mcap") for name in names)
    for other in others:
        pairs = zip(first, other, strict=True)
        assert all(np.array_equal(a.image, b.image) for a, b in pairs)


class Packets:
    """The packets of a log, some of them lost."""

    def __init__(self, path: Path, lost: set[int]) -> None:
        self.lost = lost
        with open_log(path) as log:
            stream = log.frames(log.select())
            self.packets: list[Picture] = [
                CompressedPicture(f.stamp_ns, "h264", f.decode().payload) for f in stream
            ]

    def __len__(self) -> int:
        return len(self.packets)

    def picture(self, position: int) -> Picture:
        if position in self.lost:
            raise FrameError("a chunk whose checksum is wrong")
        return self.packets[position]


def readable(packets: Packets) -> list[int]:
    video, found = Video(packets), []
    for position in range(len(packets)):
        try:
            video.picture(position)
        except FrameError:
            continue
        found.append(position)
    return found


def test_frames_that_build_upon_a_lost_one_are_lost_until_the_next_keyframe(data: Path) -> None:
    path = data / "mcap" / "flavours" / "fox_pb_CompressedVideo_h264.mcap"
    keyframes = [i for i, packet in enumerate(Packets(path, set()).packets) if is_keyframe(packet)]
    assert keyframes[0] == 0
    following = [frame for frame in keyframes if frame > 3]
    resumed = range(following[0], 12) if following else []
    assert readable(Packets(path, set())) == list(range(12))
    assert readable(Packets(path, {3})) == [0, 1, 2, *resumed]


def test_a_video_without_its_keyframe_is_not_guessed_at(data: Path) -> None:
    packets = Packets(data / "mcap" / "flavours" / "fox_pb_CompressedVideo_h264.mcap", {0})
    with pytest.raises(FrameError, match=r"keyframe|builds upon"):
        Video(packets).picture(1)


def test_without_the_decoder_its_extra_is_named(
    video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(LogError, match=r"pip install 'roadeval\[video\]'"):
        frames(video)


ENCODERS = {
    "h264": ("libx264", {"preset": "veryfast", "bf": "0"}),
    "h265": ("libx265", {"preset": "ultrafast", "x265-params": "bframes=0:log-level=none"}),
    "vp9": ("libvpx-vp9", {"lag-in-frames": "0", "deadline": "realtime"}),
    "av1": ("libsvtav1", {"preset": "12", "svtav1-params": "pred-struct=1:lookahead=0"}),
}


def ramp(number: int) -> npt.NDArray[np.uint8]:
    """A bright bar that moves with the frame's number."""
    image = np.full((96, 128, 3), 40, np.uint8)
    image[:, 10 * number : 10 * number + 20] = 200
    return image


def encode(codec: str, count: int) -> list[bytes]:
    """Encode frames without any that look ahead; a keyframe every fourth."""
    import av

    name, options = ENCODERS[codec]
    try:
        encoder = av.CodecContext.create(name, "w")
    except av.FFmpegError:
        pytest.skip(f"PyAV was built without {name}")
    encoder.width, encoder.height, encoder.pix_fmt = 128, 96, "yuv420p"
    encoder.framerate, encoder.time_base, encoder.gop_size = 10, Fraction(1, 10), 4
    encoder.options = options
    packets = []
    for number in range(count):
        frame = av.VideoFrame.from_ndarray(ramp(number), "rgb24")
        frame.pts = number
        packets += encoder.encode(frame)
    packets += encoder.encode(None)
    return [bytes(packet) for packet in packets]


@pytest.mark.parametrize("codec", ENCODERS)
def test_every_codec_is_decoded_from_any_frame(tmp_path: Path, codec: str) -> None:
    path = tmp_path / "video.mcap"
    with path.open("wb") as file, Writer(file) as writer:
        for number, data in enumerate(encode(codec, 10)):
            message = CompressedVideo(data=data, format=codec)
            message.timestamp.FromNanoseconds(number * 100)
            writer.write_message("/video", message, number * 100)
    found = frames(path)
    late = frames(path, Span(Instant(600)))
    assert [frame.number for frame in found] == list(range(10))
    assert all(np.abs(f.image.astype(int) - ramp(f.number)).mean() < 5 for f in found)
    assert all(np.array_equal(a.image, b.image) for a, b in zip(late, found[6:], strict=True))


def test_parameters_in_a_packet_of_their_own_announce_a_keyframe(data: Path) -> None:
    first = Packets(data / "mcap" / "flavours" / "fox_pb_CompressedVideo_h264.mcap", set()).packets[
        0
    ]
    whole = bytes(first.data)
    parameters = whole[: whole.index(b"\x00\x00\x01\x65")]
    assert is_keyframe(CompressedPicture(0, "h264", parameters))
    assert not is_keyframe(CompressedPicture(0, "h264", b"no video"))
