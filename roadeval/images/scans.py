"""Scans of a JPEG: how often the decoder goes through the whole image."""

from __future__ import annotations

import re
from typing import Final

from roadeval.images.errors import ImageError

MOST_SCANS: Final = 100
"""Most scans of a file; libtiff has the same bound. Encoders write some ten. A scan of a few bytes
can cost the decoder a walk through the whole image: 200 kB of them would take over a minute."""
_START: Final = b"\xff\xda"
_END: Final = 0xD9
_MARKER: Final = re.compile(rb"\xff[\xc0-\xcf\xd9-\xfe]")
"""Markers that end a scan: in its data a byte 255 is followed by 0, or by a restart marker."""


def check_scans(data: bytes | memoryview) -> None:
    """Refuse a JPEG of too many scans, before it is decoded; an `ImageError`."""
    data = bytes(data)
    # What lies in a segment or behind the image can look like a scan: only a hundred of them tell.
    if data.count(_START) > MOST_SCANS and _scans(data) > MOST_SCANS:
        raise ImageError(f"a JPEG of more than {MOST_SCANS} scans, which takes too long to decode")


def _scans(data: bytes) -> int:
    """Count the scans from the first marker to the image's end."""
    at, count = 2, 0
    while (found := _MARKER.search(data, at)) is not None and data[found.end() - 1] != _END:
        at = found.end()
        count += found.group() == _START
        at += int.from_bytes(data[at : at + 2], "big")
    return count
