"""Masks that numbers pair with frames, in logs that have lost some of their images."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from roadeval.data import Frame
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, MaskSettings
from tests.fixtures import broken
from tests.fixtures.broken import (
    FRAMES,
    HEAD,
    HEIGHT,
    WIDTH,
    chunk,
    good,
    length_of,
    message,
    over,
)
from tests.fixtures.writing import START
from tests.logs.making import png

BITS = 6
WHOLE = ("ok", "unchunked", "noindex", "nostats", "dataend_crc_bad", "trunc_last1")
NUMBERED = ("chunk_crc_field_bad", "chunk_data_flip_lz4")
"""Damage of which the index tells how many messages it took."""
CUT = {"trunc_midchunk": 36, "trunc_unchunked": 28}
HOLES = {"zero_hole": (6, 32), "huge_len_msg_unchunked": (5, 34)}
"""Damage that took an unknown number of messages: the first frame that is lost, and how many are
left after it."""


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
    with open_log(path, LogConfig(masks={"net": settings})) as log:
        selection = log.select()
        for logged in log.frames(selection):
            try:
                frame = logged.decode()
            except FrameError:
                continue
            if "net" in frame.external:
                found[_number(frame)] = _told(frame)
        return found, selection.masks["net"].pairing.unsure


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
    first, left = HOLES[name]
    own = {number: number for number in range(first)}
    assert paired(damaged(tmp_path, name), by_number(masks)) == (own, left)


@pytest.mark.parametrize("twice", [False, True])
def test_a_chunk_that_lacks_or_is_there_twice_leaves_no_number_sure(masks, tmp_path, twice):
    data = good()
    at = chunk(3, data)
    end = at + length_of(data, at)
    path = saved(tmp_path, data[:at] + data[at:end] * (2 * twice) + data[end:])
    assert paired(path, by_number(masks))[0] == {}


def test_a_hole_among_chunks_out_of_order_leaves_no_number_sure_that_lies_behind_it(
    masks, tmp_path
):
    numbers = [10, 11, 0, 1, 12, 13, *range(2, 10), *range(14, FRAMES)]
    data = broken.log(numbers).bytes()
    begin, end, last = chunk(1, data), chunk(2, data), chunk(19, data)
    without_summary = over(data, begin, bytes(end - begin))[:last]
    assert paired(saved(tmp_path, without_summary), by_number(masks))[0] == {}


def test_a_message_whose_channel_is_damaged_leaves_no_number_after_it_sure(masks, tmp_path):
    data = good("unchunked")
    found, _ = paired(
        saved(tmp_path, over(data, message(13, data) + HEAD, b"\7")), by_number(masks)
    )
    assert found == {number: number for number in range(13)}


@pytest.mark.parametrize(
    ("spoilt", "content"),
    [
        (0, lambda data: bytes(len(data))),
        (1, lambda data: bytes(len(data))),
        (1, lambda data: b""),
        (1, lambda data: data[:8]),
        (0, lambda data: data[:60]),
        (1, None),
    ],
    ids=["first zeroed", "zeroed", "empty", "nothing in it", "without a topic", "missing"],
)
def test_a_file_of_a_split_log_that_is_lost_leaves_no_number_sure(masks, tmp_path, spoilt, content):
    parts = [range(14), range(14, 28), range(28, FRAMES)]
    for place, part in enumerate(parts):
        data = broken.log([*part]).bytes()
        whole = tmp_path / f"drive_{place}.mcap"
        if place != spoilt:
            whole.write_bytes(data)
        elif content is not None:
            whole.write_bytes(content(data))
    found, unsure = paired(tmp_path, by_number(masks))
    assert (found, unsure) == ({}, FRAMES - len(parts[spoilt]))


def test_what_a_split_log_lost_at_the_end_of_a_file_shifts_no_number_before_it(masks, tmp_path):
    for place, part in enumerate((range(14), range(14, FRAMES))):
        data = broken.log([*part]).bytes()
        whole = tmp_path / f"drive_{place}.mcap"
        whole.write_bytes(data[: chunk(3, data) - 1] if place == 0 else data)
    found, unsure = paired(tmp_path, by_number(masks))
    assert found == {number: number for number in range(6)}
    assert unsure == FRAMES - 14


@pytest.mark.parametrize("later_ns", [0, -(10**12), 10**12])
def test_masks_of_another_log_lose_their_numbers_too(tmp_path, later_ns):
    """Whatever the log times of the other log."""
    made = broken.log()
    moved = [replace(each, log_time=each.log_time + later_ns) for each in made.messages]
    data = replace(made, messages=tuple(moved)).bytes()
    begin, end = chunk(3, data), chunk(4, data)
    other = tmp_path / "other.mcap"
    other.write_bytes(over(data, begin, bytes(end - begin)))
    settings = MaskSettings(path=f"{other}:{broken.MASK}", pair="number")
    with open_log(saved(tmp_path, good()), LogConfig(masks={"net": settings})) as log:
        selection = log.select()
        seen = [frame.number for frame in log.frames(selection) if "net" in frame.labels]
    assert seen == list(range(6))
    assert selection.masks["net"].pairing.unsure == FRAMES - 6


def test_the_truth_is_not_held_against_itself_by_the_log_s_own_path(tmp_path):
    path = saved(tmp_path, good())
    itself = LogConfig(masks={"net": MaskSettings(path=f"{path}:{broken.MASK}")})
    with (
        open_log(path, itself) as log,
        pytest.raises(LogError, match="is the truth that it is scored"),
    ):
        log.select()


@pytest.mark.parametrize("count", [FRAMES - 1, FRAMES + 1])
def test_a_log_that_was_not_made_of_the_images_is_refused(masks, tmp_path, count):
    images = _images(tmp_path, count)
    settings = MaskSettings(path=str(masks), images=str(images))
    with pytest.raises(LogError, match=f"holds {count} images and the log 40, so it was not made"):
        paired(damaged(tmp_path, "ok"), settings)


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
