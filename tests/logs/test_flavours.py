"""Every kind of camera message, each in a small log, decodes to the frames it was made from."""

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from roadeval.data import Frame
from roadeval.logs import FrameError, LogError, open_log

Rgb = npt.NDArray[np.uint8]

LOSSY = 2.5
"""Largest mean absolute error, in grey levels, that compression or a mosaic explains."""
CHROMA_HALVED = 6.5
"""The same where colour is stored for every other pixel, in a range nobody tells."""

COLOUR = {
    "fox_fb_CompressedImage": LOSSY,
    "fox_json_CompressedImage": LOSSY,
    "fox_json_RawImage": 0.0,
    "fox_pb_CompressedImage": LOSSY,
    "fox_pb_RawImage": 0.0,
    "foxmsgs_ros2_CompressedImage": LOSSY,
    "json_ros_sensor_msgs_CompressedImage": LOSSY,
    "ros1_CompressedImage": LOSSY,
    "ros1_Image_bgr8": 0.0,
    "ros2_CompressedImage_bgr8_jpeg-compressed-bgr8": LOSSY,
    "ros2_CompressedImage_bgr8_png-compressed-bgr8": 0.0,
    "ros2_CompressedImage_jpeg": LOSSY,
    "ros2_CompressedImage_rgb8_jpeg-compressed-bgr8": LOSSY,
    "ros2_CompressedImage_tiff": 0.0,
    "ros2_CompressedImage_webp": LOSSY,
    "ros2_Image_8UC3": 0.0,
    "ros2_Image_BGR8_upper": 0.0,
    "ros2_Image_bayer_bggr8": LOSSY,
    "ros2_Image_bayer_grbg8": LOSSY,
    "ros2_Image_bayer_rggb8": LOSSY,
    "ros2_Image_bgr16": 0.0,
    "ros2_Image_bgr8": 0.0,
    "ros2_Image_bgr8_padded": 0.0,
    "ros2_Image_bgr8_step0": 0.0,
    "ros2_Image_nv12": CHROMA_HALVED,
    "ros2_Image_rgb8": 0.0,
    "ros2_Image_rgba8": 0.0,
    "ros2_Image_ros2idl": 0.0,
    "ros2_Image_yuv422": CHROMA_HALVED,
    "ros2_Image_yuv422_yuy2": CHROMA_HALVED,
    "ros2_Image_yuyv": CHROMA_HALVED,
}
GREY = {
    "ros2_CompressedImage_mono8png": 0.0,
    "ros2_Image_16UC1": 0.0,
    "ros2_Image_32FC1": 0.0,
    "ros2_Image_8UC1": 0.0,
    "ros2_Image_mono16": 0.0,
    "ros2_Image_mono8": 0.0,
}
VIDEO = (
    "fox_pb_CompressedVideo_h264",
    "fox_pb_CompressedVideo_vp9",
    "ros2_CompressedImage_h264",
    "ros2_FFMPEGPacket_h264",
)
REFUSED = {
    "ros2_CompressedImage_compressedDepth": "it holds depth",
    "ros2_Image_bgr8_shortdata": "56600 bytes of pixels where 57600 are needed",
}


def frames(path: Path) -> list[Frame]:
    with open_log(path) as log:
        return [frame.decode() for frame in log.frames(log.select())]


def expected(folder: Path, *, grey: bool) -> list[Rgb]:
    images = [cv2.imread(str(folder / f"expected_{i}.png")) for i in range(5)]
    if grey:
        images = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in images]
    code = cv2.COLOR_GRAY2RGB if grey else cv2.COLOR_BGR2RGB
    return [cv2.cvtColor(image, code) for image in images]


def error(found: Rgb, wanted: Rgb) -> float:
    return float(np.abs(found.astype(int) - wanted).mean())


def test_the_table_names_every_file(data: Path) -> None:
    names = {path.stem for path in (data / "mcap" / "flavours").glob("*.mcap")}
    assert names == {*COLOUR, *GREY, *VIDEO, *REFUSED}


@pytest.mark.parametrize("name", [*COLOUR, *GREY])
def test_frames_are_those_expected(data: Path, name: str) -> None:
    folder = data / "mcap" / "flavours"
    found = frames(folder / f"{name}.mcap")
    assert len(found) == 5
    for frame, wanted in zip(found, expected(folder, grey=name in GREY), strict=True):
        assert error(frame.image, wanted) <= {**COLOUR, **GREY}[name]


@pytest.mark.parametrize("name", VIDEO)
def test_every_frame_of_a_video_is_decoded(data: Path, name: str) -> None:
    found = frames(data / "mcap" / "flavours" / f"{name}.mcap")
    assert [frame.image.shape for frame in found] == [(240, 320, 3)] * 12
    assert [frame.number for frame in found] == list(range(12))
    moved = [error(a.image, b.image) for a, b in pairwise(found)]
    assert min(moved) > 0


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_image_is_called_by_its_name(data: Path, name: str) -> None:
    with pytest.raises((LogError, FrameError), match=REFUSED[name]):
        frames(data / "mcap" / "flavours" / f"{name}.mcap")
