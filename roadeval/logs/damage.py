"""What is wrong with a log, in sentences that say where, when and what is lost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Damage:
    """Something wrong with a file.

    Parameters
    ----------
    path, offset
        The file, and the byte where it begins.
    reason
        What it is.
    lossy
        Whether messages are, or may be, lost or wrong by it.
    start_ns, end_ns
        Log times of the messages before and after what is lost, None where nothing tells.
    lost
        Topics and numbers of messages that are known to be lost.
    log_start_ns
        From where a sentence counts its seconds.
    """

    path: Path
    offset: int
    reason: str
    lossy: bool = True
    start_ns: int | None = None
    end_ns: int | None = None
    lost: tuple[tuple[str, int], ...] = ()
    log_start_ns: int = 0

    def __str__(self) -> str:
        text = f"{self.path.name}: {self.reason} (byte {self.offset}{self._span()})"
        if self.lost:
            listed = ", ".join(f"{count} of {topic}" for topic, count in self.lost)
            text += f"; lost: {listed}"
        elif not self.lossy:
            text += "; no message is lost"
        return text

    def _span(self) -> str:
        """Say when, in seconds after the log's start."""
        start, end = (
            None if time is None else f"{(time - self.log_start_ns) / NS:.3f}"
            for time in (self.start_ns, self.end_ns)
        )
        if start is not None and end is not None:
            return f", {start} to {end} s"
        if start is not None:
            return f", after {start} s"
        return f", before {end} s" if end is not None else ""
