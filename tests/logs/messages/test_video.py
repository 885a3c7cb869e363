"""Video in a log: frames that need the frames before them."""

from collections.abc import Collection
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from roadeval.images.formats import Limits
from roadeval.logs.errors import FrameError
from roadeval.logs.log import open_log
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import CompressedPicture, Video, is_keyframe
from roadeval.logs.settings import FrameSettings, LabelPlace, LabelSettings, LogConfig
from tests.fixtures.flavours import ENCODERS, VIDEO_FRAMES, bar, packets
from tests.fixtures.shared import both
from tests.logs.making import compressed, frames, png, ros2_log

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


def encoded(pictures: list[np.ndarray], bf: int) -> list[tuple[int, bytes]]:
    """Encode planes of luma nearly without loss, ``bf`` B-frames in a row: places and packets."""
    import av

    encoder = av.CodecContext.create("libx264", "w")
    encoder.height, encoder.width = pictures[0].shape
    encoder.pix_fmt, encoder.framerate, encoder.time_base = "yuv420p", 10, Fraction(1, 10)
    encoder.max_b_frames = bf
    encoder.options = {"x264-params": "qp=1:scenecut=0:b-adapt=0"}
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


@pytest.mark.parametrize("full_range", [False, True])
def test_luma_beyond_its_range_is_told_and_read_as_asked(full_range: bool) -> None:
    levels = np.repeat(np.array([16, 64, 128, 192, 240, 250], np.uint8), 16)
    packets = stamped(encoded([levels[None].repeat(48, 0)] * 3, 0))
    video = Video(packets, Limits(full_range=full_range))
    grey = video.picture(0).pixels[24, 8::16, 0].astype(int)
    expected = levels[8::16] if full_range else [0, 56, 130, 205, 255, 255]
    assert np.abs(grey - expected).max() < 3
    assert (video.notes.get("range") is None) == full_range
