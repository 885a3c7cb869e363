"""Masks that numbers pair with frames, in logs that have lost some of their images."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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


def marked(number: int) -> bytes:
    """Return a mask that tells its number by its first row."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[0, :BITS] = [255 * (number >> bit & 1) for bit in range(BITS)]
    return png(mask)


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> MaskSettings:
    folder = tmp_path_factory.mktemp("masks")
    for number in range(FRAMES):
        (folder / f"{number:04}.png").write_bytes(marked(number))
    return MaskSettings(path=str(folder))


def paired(path: Path, settings: MaskSettings) -> tuple[list[int], int]:
    """Return the frames, by the number that each stamp is, that have a mask, and `unsure`.

    The mask must be the frame's own.
    """
    numbers = []
    with open_log(path, LogConfig(masks={"net": settings})) as log:
        selection = log.select()
        for logged in log.frames(selection):
            with suppress(FrameError):
                frame = logged.decode()
                if "net" in frame.external:
                    numbers.append((frame.stamp_ns - START) // broken.PERIOD)
                    bits = frame.external["net"][0, :BITS].tolist()
                    assert numbers[-1] == sum(bit << place for place, bit in enumerate(bits))
        return numbers, selection.masks["net"].pairing.unsure


def saved(folder: Path, data: bytes) -> Path:
    path = folder / "drive.mcap"
    path.write_bytes(data)
    return path


def without_a_chunk(times: int) -> bytes:
    data = good()
    at = chunk(3, data)
    end = at + length_of(data, at)
    return data[:at] + data[at:end] * times + data[end:]


def out_of_order() -> bytes:
    data = broken.log([10, 11, 0, 1, 12, 13, *range(2, 10), *range(14, FRAMES)]).bytes()
    begin, end, last = chunk(1, data), chunk(2, data), chunk(19, data)
    return over(data, begin, bytes(end - begin))[:last]


def foreign_message() -> bytes:
    data = good("unchunked")
    return over(data, message(13, data) + HEAD, b"\7")


WHOLE = ("ok", "unchunked", "noindex", "nostats", "dataend_crc_bad", "trunc_last1")
COUNTED = ("chunk_crc_field_bad", "chunk_data_flip_lz4")
CASES: dict[str, tuple[Any, list[int], int | None]] = {
    **{name: (name, [*range(FRAMES)], 0) for name in WHOLE},
    # The index tells how many messages the damage took.
    **{name: (name, [n for n in range(FRAMES) if n not in {6, 7}], 0) for name in COUNTED},
    "trunc_midchunk": ("trunc_midchunk", [*range(36)], 0),
    "trunc_unchunked": ("trunc_unchunked", [*range(28)], 0),
    # It took an unknown number, before so many frames that are left.
    "zero_hole": ("zero_hole", [*range(6)], 32),
    "huge_len_msg_unchunked": ("huge_len_msg_unchunked", [*range(5)], 34),
    "a chunk lacks": (lambda: without_a_chunk(0), [], None),
    "a chunk is there twice": (lambda: without_a_chunk(2), [], None),
    "a hole among chunks out of order": (out_of_order, [], None),
    "a message of another channel": (foreign_message, [*range(13)], None),
}


@pytest.mark.parametrize("case", CASES)
def test_a_frame_has_its_own_mask_or_none_whatever_was_lost_before_it(masks, tmp_path, case):
    made, expected, unsure = CASES[case]
    data = made() if callable(made) else broken.BROKEN[made][1]().data
    result = paired(saved(tmp_path, data), masks)
    assert result == (expected, result[1] if unsure is None else unsure)


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
        if place != spoilt or content is not None:
            data = content(data) if place == spoilt else data
            (tmp_path / f"drive_{place}.mcap").write_bytes(data)
    assert paired(tmp_path, masks) == ([], FRAMES - len(parts[spoilt]))


def test_what_a_split_log_lost_at_the_end_of_a_file_shifts_no_number_before_it(masks, tmp_path):
    for place, part in enumerate((range(14), range(14, FRAMES))):
        data = broken.log([*part]).bytes()
        data = data[: chunk(3, data) - 1] if place == 0 else data
        (tmp_path / f"drive_{place}.mcap").write_bytes(data)
    assert paired(tmp_path, masks) == ([*range(6)], FRAMES - 14)


@pytest.mark.parametrize("later_ns", [0, -(10**12), 10**12])
def test_masks_of_another_log_lose_their_numbers_too(tmp_path, later_ns):
    """Whatever the log times of the other log."""
    made = broken.log()
    moved = [replace(message, log_time=message.log_time + later_ns) for message in made.messages]
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
    (tmp_path / "images").mkdir()
    for number in range(count):
        (tmp_path / "images" / f"{number:04}.jpg").touch()
    settings = replace(masks, images=str(tmp_path / "images"))
    with pytest.raises(LogError, match=f"holds {count} images and the log 40, so it was not made"):
        paired(saved(tmp_path, good()), settings)


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
