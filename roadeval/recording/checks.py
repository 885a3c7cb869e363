"""Check sums of a recording's messages, by which damage is found before anything is read.

A Rerun file is a row of messages, each behind a header, and its index is the last of them::

    RRF2  [header|message] [header|message] ...  [header|sums] [header|mark] [header|index]

Rerun has a check sum for the index alone. Damage elsewhere is read as other numbers and pictures
where it still unpacks; where it does not, Rerun's library may end the process, for it is built so
that what it never expects aborts. So every message has a sum here. Together they are a document,
and the place and the sum of that stand in the path of an entity, for paths are in the index.

A file that another program has written anew has its messages in other places: then they tell
nothing.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple
from zlib import crc32

from roadeval.recording.layout import SUMS

_BEGIN: Final = 12
"""Bytes before the first header."""
_HEADER: Final = struct.Struct("<QQ")
"""The kind of a message, and its length in bytes."""
_PROBE: Final = """
import sys
from rerun.chunk import RrdReader
try:
    reader = RrdReader(sys.argv[1])
    for entry in reader.recordings():
        for chunk in reader.stream(store=entry):
            chunk.to_record_batch()
except Exception:
    pass
"""


class Place(NamedTuple):
    """Where a message lies in the file, without its header, in bytes."""

    offset: int
    size: int


class MessageSums:
    """The sums of the messages of a file that is being written."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._next = _BEGIN
        self._sums: list[tuple[int, int]] = []

    def read_on(self) -> None:
        """Take in what was written to the file since."""
        with self._path.open("rb") as file:
            file.seek(self._next)
            while len(header := file.read(_HEADER.size)) == _HEADER.size:
                _, size = _HEADER.unpack(header)
                message = file.read(size)
                if len(message) < size:
                    return
                self._sums.append((self._next + _HEADER.size, crc32(message)))
                self._next += _HEADER.size + size

    def document(self) -> str:
        """Return all sums by the messages' offsets, from which `sums_of` reads them."""
        return json.dumps(self._sums)

    def mark(self) -> str:
        """Return the path of the entity that tells where the last message lies, and its sum."""
        offset, total = self._sums[-1]
        return f"{SUMS}/{offset}_{total:08x}"


def sums_of(document: str) -> dict[int, int]:
    """Return the sums of a file's messages by their offsets; a ValueError if there are none."""
    return {int(offset): int(total) for offset, total in json.loads(document)}


def marked(places: Mapping[str, Sequence[Place]]) -> dict[int, int]:
    """Return the sum of the document of sums by its offset, as the paths of a recording tell it.

    There is none in a file by an earlier version, or written anew by another program.
    """
    own = [place.offset for place in places.get(SUMS, ())]
    marks = [path.rpartition("/")[2] for path in places if path.startswith(f"{SUMS}/")]
    found = {int(place): int(total, 16) for place, _, total in (m.partition("_") for m in marks)}
    return found if own == [*found] else {}


def sum_at(path: Path, place: Place) -> int:
    """Return the sum of what lies at a place in a file."""
    with path.open("rb") as file:
        file.seek(place.offset)
        return crc32(file.read(place.size))


def can_be_read(path: Path) -> bool:
    """Return whether Rerun gets through a file that has no sums, without ending its process.

    It is read once in another process for that.
    """
    # -P: a rerun.py that lies beside the recordings must not be what is imported.
    probe = [sys.executable, "-P", "-c", _PROBE, str(path)]
    return subprocess.run(probe, check=False, capture_output=True).returncode == 0
