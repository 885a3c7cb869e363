"""A log that is damaged somewhere, against the intact one: nothing is lost or wrong untold.

What is promised of a log whose chunks have checksums:

- A frame that is read is the frame that was logged: stamp, image and truth. If it cannot be, it is
  named as unreadable.
- A frame that is missing, or there twice, is told: by a sentence on what is lost, or by refusing
  the log.
- A frame whose chunks are intact is read, unless the whole log is refused.
- No other frame suffers from damage inside one message.

Without checksums of chunks the whole file may have one; then a wrong frame is possible, and told.
What nobody can tell is a change inside a message under checksums that are right: if the image
still decodes, it is taken for what was logged. Of such frames only the limits are promised.
"""

from __future__ import annotations

from tests.fuzz.changes import Choices
from tests.fuzz.damages import Damaged, damaged
from tests.fuzz.harness import Harness, Lost, Wrong, scratch
from tests.fuzz.intact import SAID, UNSAID, Intact, Reading, Seen, intact_logs, read


def check(data: bytes) -> None:
    """Damage a log as the bytes say, and compare what is read of it with the intact log."""
    intact, bad = made(data)
    path = scratch() / "drive.mcap"
    path.write_bytes(bad.data)
    # A value that damage brings into a mask may change what all its values mean.
    compare(intact, bad, read(path, SAID if bad.reached else UNSAID))


def made(data: bytes) -> tuple[Intact, Damaged]:
    """Return the log that the bytes choose, and the damaged one."""
    choices = Choices(data)
    intact = choices.of(tuple(intact_logs().values()))
    return intact, damaged(intact, choices)


def compare(intact: Intact, bad: Damaged, reading: Reading) -> None:
    """Raise `Wrong` or `Lost` for what is not told, `Wrong` also for what must not be."""
    found = dict(reading.frames)
    for time, logged in intact.frames.items():
        if time in bad.reached or found.get(time) == logged:
            continue
        number = intact.number_of(time)
        if time not in found or found[time] == logged._replace(truth=None):
            whole = intact.by_chunk and intact.is_whole(time, bad.data)
            if whole and time not in found and found:
                raise Lost(f"frame {number}, whose chunks are intact")
            if not (reading.told or (time in found and reading.without_truth)):
                raise Lost(f"frame {number}" + " loses its truth" * (time in found))
        elif not reading.told or intact.is_whole(time, bad.data):
            raise Wrong(f"frame {number}: another {_difference(logged, found[time])}")
    if not reading.told and len(reading.frames) > len(intact.frames):
        raise Wrong(f"{len(reading.frames)} frames of {len(intact.frames)}")


def _difference(logged: Seen, found: Seen) -> str:
    names = [name for name in logged._fields if getattr(logged, name) != getattr(found, name)]
    return ", ".join(names)


HARNESS = Harness(check, lambda: [b"", b"\1" * 64], random=True, quick=200)
