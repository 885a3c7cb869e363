"""Images that are stored turned: shown as viewers and annotation tools show them.

OpenCV 5 turns JPEG, PNG and WebP by their EXIF orientation, Pillow 13 TIFF alone; FFmpeg's players
turn a video by its display matrix, PyAV 18 hands it over as it is stored.
"""

import io
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image, ImageOps

from roadeval.images.decoding import size_of, to_rgb, upright
from roadeval.images.formats import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.log import describe, open_log
from roadeval.logs.messages.pictures import turn_of
from roadeval.logs.settings import FrameSettings, LogConfig, TopicSettings
from roadeval.logs.writing.writer import pack
from tests.fixtures.shared import shared
from tests.images.making import scene
from tests.logs.making import compressed, png, ros2_log


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
    pixels = to_rgb(data, Limits(turn=True))
    np.testing.assert_array_equal(pixels, shown)
    assert size_of(data, Limits(turn=True)) == pixels.shape[1::-1]
    assert size_of(data, Limits()) == stored.shape[1::-1]


@pytest.mark.parametrize("flip", [1, -1])
@pytest.mark.parametrize("quarters", range(4))
def test_a_display_matrix_turns_each_pixel_to_its_place(quarters: int, flip: int) -> None:
    turn = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarters) @ np.diag([flip, 1])
    (a, c), (b, d) = (turn * 65536).tolist()
    matrix = struct.pack("=9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)

    class Side(bytes):
        type = SimpleNamespace(name="DISPLAYMATRIX")

    pixels = np.arange(6).reshape(2, 3)
    expected = {}
    for (row, column), value in np.ndenumerate(pixels):
        x, y = turn @ (column, row)
        expected[int(value)] = y, x
    rows, columns = (np.array([place[axis] for place in expected.values()]) for axis in (0, 1))
    shown = np.zeros((np.ptp(rows) + 1, np.ptp(columns) + 1), int)
    shown[rows - rows.min(), columns - columns.min()] = [*expected]
    orientation = turn_of(SimpleNamespace(side_data=[Side(matrix)]))
    np.testing.assert_array_equal(upright(pixels, orientation), shown)


@pytest.mark.parametrize("videos", shared("failures", "reality", "turned_video"))
@pytest.mark.parametrize(("name", "turns"), [("quarter_turn", -1), ("upside_down", 2)])
def test_pack_turns_a_video_as_players_do_and_says_so(tmp_path, videos, name, turns):
    shown = []
    for video in ("plain", name):
        packed = pack(videos / f"{video}.mp4", tmp_path / f"{video}.mcap")
        assert bool(packed.warnings) == (video != "plain")
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
        pick = describe(path, config).picks[0]
        assert ("are as stored" if unturned else "are turned, as their EXIF") in pick
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
    (warning,) = pack(tmp_path / "images", tmp_path / "a.mcap").warnings
    assert warning.startswith(
        "images that their EXIF orientation turns, in replay as in viewers: 6"
    )
