"""Where a run writes, and that nothing which it reads lies there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from roadeval.config import OutputSettings
from roadeval.errors import RoadevalError

AnyPath = str | Path


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files and folders of a run."""

    recording: Path
    reports: Path
    mcap: Path | None

    @classmethod
    def of(cls, settings: OutputSettings, drive: str) -> Outputs:
        """Return where a drive's results land: where the settings say, or under its name."""
        return cls(
            Path(settings.save or Path("recordings", f"{drive}.rrd")),
            Path(settings.reports or Path("reports", drive)),
            Path(settings.mcap) if settings.mcap else None,
        )


def keep_apart(inputs: Iterable[AnyPath | None], outputs: Iterable[AnyPath | None]) -> None:
    """Refuse, as a `RoadevalError`, an output that would replace an input or another output."""
    taken = {Path(path).resolve() for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        if Path(path).resolve() in taken:
            raise RoadevalError(f"{path}: is an input or another output; name a file of its own")
        taken.add(Path(path).resolve())
