"""Pixels as logged, to RGB."""

import numpy as np
import pytest

from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import RawPicture
from roadeval.logs.messages.pixels import to_labels, to_rgb

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
