"""Masks that numbers pair with frames, in logs that have lost some of their images."""

from pathlib import Path

import numpy as np
import pytest

from roadeval.data import Frame
from roadeval.logs import FrameError, LogError, MaskSettings, open_log
from tests.fixtures import broken
from tests.fixtures.broken import FRAMES, HEIGHT, WIDTH, chunk, good, length_of, message, over
from tests.fixtures.writing import START
from tests.logs.making import png

BITS = 6
WHOLE = ("ok", "unchunked", "noindex", "nostats", "dataend_crc_bad", "trunc_last1")
NUMBERED = ("chunk_crc_field_bad", "chunk_data_flip_lz4")
"""Damage of which the index tells how many messages it took."""
CUT = {"trunc_midchunk": 36, "trunc_unchunked": 28}
HOLES = {"zero_hole": 6, "huge_len_msg_unchunked": 5}
"""Damage that took an unknown number of messages, by the first frame that is lost."""


def marked(number: int) -> bytes:
    """Return a mask that tells its number by its first row."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[0, :BITS] = [255 * (number >> bit & 1) for bit in range(BITS)]
    return png(mask)


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("masks")
    for number in range(FRAMES):
        (folder / f"{number:04}.png").write_bytes(marked(number))
    return folder


def paired(path: Path, settings: MaskSettings) -> tuple[dict[int, int], int]:
    """Return the number of each frame's mask by the number that its stamp is, and `unsure`."""
    found = {}
    with open_log(path) as log:
        selection = log.select(masks={"net": settings})
        for logged in log.frames(selection):
            try:
                frame = logged.decode()
            except FrameError:
                continue
            if "net" in frame.external:
                found[_number(frame)] = _told(frame)
        return found, selection.elsewhere["net"].pairing.unsure


def _number(frame: Frame) -> int:
    return (frame.stamp_ns - START) // broken.PERIOD


def _told(frame: Frame) -> int:
    bits = frame.external["net"][0, :BITS].tolist()
    return sum(bit << place for place, bit in enumerate(bits))


def saved(folder: Path, data: bytes) -> Path:
    path = folder / "drive.mcap"
    path.write_bytes(data)
    return path


def damaged(folder: Path, name: str) -> Path:
    return saved(folder, broken.BROKEN[name][1]().data)


def by_number(masks: Path) -> MaskSettings:
    return MaskSettings(path=str(masks))


@pytest.mark.parametrize("name", WHOLE)
def test_every_frame_of_a_log_that_lacks_nothing_has_its_mask(masks, tmp_path, name):
    own = {number: number for number in range(FRAMES)}
    assert paired(damaged(tmp_path, name), by_number(masks)) == (own, 0)


@pytest.mark.parametrize("name", NUMBERED)
def test_lost_images_that_are_counted_shift_no_number(masks, tmp_path, name):
    own = {number: number for number in range(FRAMES) if number not in (6, 7)}
    assert paired(damaged(tmp_path, name), by_number(masks)) == (own, 0)


@pytest.mark.parametrize("name", CUT)
def test_what_is_cut_off_shifts_no_number(masks, tmp_path, name):
    own = {number: number for number in range(CUT[name])}
    assert paired(damaged(tmp_path, name), by_number(masks)) == (own, 0)


@pytest.mark.parametrize("name", HOLES)
def test_after_a_loss_of_unknown_length_no_frame_has_a_mask(masks, tmp_path, name):
    found, unsure = paired(damaged(tmp_path, name), by_number(masks))
    first = HOLES[name]
    assert found == {number: number for number in range(first)}
    assert unsure >= FRAMES - first - 3


@pytest.mark.parametrize("twice", [False, True])
def test_a_chunk_that_lacks_or_is_there_twice_leaves_no_number_sure(masks, tmp_path, twice):
    data = good()
    at = chunk(3, data)
    end = at + length_of(data, at)
    path = saved(tmp_path, data[:at] + data[at:end] * (2 * twice) + data[end:])
    assert paired(path, by_number(masks))[0] == {}


def test_masks_of_another_log_lose_their_numbers_too(masks, tmp_path):
    other = damaged(tmp_path, "zero_hole")
    (tmp_path / "whole").mkdir()
    path = saved(tmp_path / "whole", good())
    settings = MaskSettings(path=f"{other}:{broken.MASK}", pair="number")
    with open_log(path) as log:
        selection = log.select(masks={"net": settings})
        seen = [frame.number for frame in log.frames(selection) if "net" in frame.labels]
    assert seen == list(range(6))
    assert selection.elsewhere["net"].pairing.unsure == FRAMES - 6


@pytest.mark.parametrize("count", [FRAMES - 1, FRAMES + 1])
def test_a_log_that_was_not_made_of_the_images_is_refused(masks, tmp_path, count):
    images = _images(tmp_path, count)
    settings = MaskSettings(path=str(masks), images=str(images))
    with pytest.raises(LogError, match=f"holds {count} images and the log 40, so it was not made"):
        paired(damaged(tmp_path, "ok"), settings)


def test_names_pair_in_a_log_that_was_cut_off(masks, tmp_path):
    settings = MaskSettings(path=str(masks), images=str(_images(tmp_path, FRAMES)))
    own = {number: number for number in range(36)}
    assert paired(damaged(tmp_path, "trunc_midchunk"), settings) == (own, 0)


def _images(folder: Path, count: int) -> Path:
    images = folder / "images"
    images.mkdir()
    for number in range(count):
        (images / f"{number:04}.jpg").touch()
    return images


@pytest.mark.parametrize("chunked", [True, False])
def test_without_any_time_labels_after_a_hole_belong_to_nobody(tmp_path, chunked):
    timeless = broken.log(list(range(FRAMES)), stamp=0, use_chunking=chunked).bytes()
    begin, end = (
        chunk(number, timeless) if chunked else message(number, timeless) for number in (3, 4)
    )
    holed = over(timeless, begin, bytes(end - begin))
    with open_log(saved(tmp_path, holed)) as log:
        stream = log.frames(log.select())
        assert [frame.number for frame in stream if frame.labels] == []
