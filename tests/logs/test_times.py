"""Moments as people write them."""

import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.settings import parse_time

SECOND = 1_000_000_000


@pytest.mark.parametrize(
    ("text", "ns", "relative"),
    [
        ("2.5", 2_500_000_000, True),
        ("90", 90 * SECOND, True),
        (".25", 250_000_000, True),
        ("0", 0, True),
        ("12s", 12 * SECOND, True),
        ("12ns", 12, False),
        ("1700000000123456789", 1_700_000_000_123_456_789, False),
        ("2.123456789", 2_123_456_789, True),
        ("1970-01-01T00:00:01.000000005Z", SECOND + 5, False),
        ("2023-11-14T23:13:20+01:00", 1_700_000_000 * SECOND, False),
    ],
)
def test_a_time_is_read_to_the_nanosecond(text: str, ns: int, relative: bool) -> None:
    assert parse_time(text) == ns
    assert parse_time(text, start_ns=7) == ns + 7 * relative


@pytest.mark.parametrize(
    "text",
    [
        "",
        ".",
        "9" * 5_000,
        "9" * 5_000 + ".5",
        "9" * 5_000 + "ns",
        "soon",
        "-3",
        "1e9",
        "2023-11-14",
        "2023-13-01T00:00:00Z",
    ],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(LogError, match="is no time"):
        parse_time(text)
