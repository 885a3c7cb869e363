"""A fleet looked into: its worst frames, and a drive at one of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from roadeval.config import OutputSettings, RunConfig, load_config
from roadeval.errors import RoadevalError
from roadeval.fleet.remote import staged
from roadeval.fleet.urls import is_url, shown
from roadeval.jobs.fleet_work import model_path
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.replay import Outcome, replay
from roadeval.results.fleet.folder import Fleet
from roadeval.results.fleet.record import PICTURES, recording_path
from roadeval.results.folder import RUN

FEWEST: Final = "worst:10"
"""The pictures that are recorded of a drive that is replayed to be looked at."""


@dataclass(frozen=True, slots=True)
class FleetFrame:
    """A frame among the worst of a fleet."""

    rank: int
    """1 is the worst."""
    drive: str
    frame: int
    stamp_ns: int
    """Which."""
    variant: str
    stage: str
    """Whose final mask."""
    rates: dict[str, float | None]
    """ERR, FPR and FNR of it."""
    light: dict[str, float | None]
    """As it was measured, by the columns' names; None where it could not be."""
    picture: Path
    """The file of its errors."""
    recording: Path | None
    """The drive's recording; None where it was not kept."""


def worst_frames(fleet: Fleet, count: int | None = None) -> list[FleetFrame]:
    """Return the worst frames of a fleet, the worst first.

    Parameters
    ----------
    fleet
        Whose.
    count
        How many, at most; all that its table names by default.

    Raises
    ------
    RoadevalError
        If there is none.
    """
    rows = fleet.table("worst").to_pylist()
    if not rows:
        raise RoadevalError(f"{fleet.path}: nothing was scored, so no frame is the worst")
    return [_frame(fleet, row) for row in rows[:count]]


def _frame(fleet: Fleet, row: dict[str, Any]) -> FleetFrame:
    names = ("rank", "drive", "frame", "stamp_ns", "variant", "stage")
    recording = recording_path(fleet.path, row["drive"])
    return FleetFrame(
        **{name: row[name] for name in names},
        rates={name: row[name] for name in ("ERR", "FPR", "FNR")},
        light={name: row[name] for name in ("luminance", "contrast", "shadow", "sun")},
        picture=fleet.path / PICTURES / row["drive"] / f"{row['frame']}.jpg",
        recording=recording if recording.exists() else None,
    )


def frame_of_rank(fleet: Fleet, rank: int) -> FleetFrame:
    """Return the frame of a rank among the worst.

    Raises
    ------
    RoadevalError
        If the fleet's table names fewer.
    """
    found = worst_frames(fleet)
    if rank > len(found):
        raise RoadevalError(f"{fleet.path}: only the worst {len(found)} frames are known")
    return found[rank - 1]


def recording_of(
    fleet: Fleet,
    drive: str,
    on_progress: OnProgress = ignore,
    on_replay: Callable[[str], None] = lambda _sentence: None,
) -> tuple[Path, tuple[str, ...]]:
    """Return the recording of a drive, made again from its log where it was not kept.

    Parameters
    ----------
    fleet, drive
        Which, by its name in the fleet.
    on_progress
        As of `roadeval.replay`.
    on_replay
        Told in a sentence that the drive is replayed.

    Returns
    -------
    tuple
        The file, and what to know of it first.

    Raises
    ------
    RoadevalError
        If there is no such drive, its log has gone or may not be read, or it cannot be replayed.
    """
    row = _row(fleet, drive)
    if (recording := fleet.recording(drive)).exists():
        return recording, ()
    recording = fleet.recording(drive, new=True)
    named, source = str(row["source"]), shown(str(row["source"]))
    if row["status"] == "failed":
        raise RoadevalError(f"{source}: has no recording, for it failed: {row['reason']}")
    if not fleet.trust_sources:
        raise RoadevalError(
            f"{drive}: no recording was kept; `trust_sources` replays it from {source}, with the "
            f"masks, networks and model of {fleet.results(drive) / RUN}"
        )
    if not is_url(named) and not Path(named).exists():
        raise RoadevalError(
            f"{source}: has gone, and no recording of it was kept; bring the log back, or see "
            f"{fleet.path / 'pictures' / drive}"
        )
    config = _configuration(fleet, drive, row["fold"])
    on_replay(f"{drive}: no recording was kept, so it is replayed from {source}")
    outcome = _replayed(named, config, recording, on_progress)
    changed = outcome.summary["log"]["sha256"] != row["sha256"]
    warning = f"{source}: has changed since the fleet was run, and its results may have, too"
    return recording, (warning,) if changed else ()


def _row(fleet: Fleet, drive: str) -> dict[str, Any]:
    """Return a drive's row of ``drives``."""
    columns = ["drive", "name", "source", "status", "reason", "sha256", "fold"]
    rows: list[dict[str, Any]] = fleet.table("drives", columns).to_pylist()
    for row in rows:
        if row["drive"] == drive:
            return row
    named = [row["drive"] for row in rows if row["name"] == drive]
    hint = f"; by that name there is {', '.join(named)}" if named else ""
    raise RoadevalError(f"{fleet.path}: no drive {drive}{hint}; `drives.parquet` names all")


def _configuration(fleet: Fleet, drive: str, fold: int | None) -> RunConfig:
    """Return what a drive was replayed with; the model of its fold as it lies in the folder now."""
    path = fleet.results(drive) / RUN
    if not path.exists():
        raise RoadevalError(f"{path}: is not there; run the fleet's command again")
    config = load_config(path, trusted=False)
    if fold is None:
        return config
    return config.override({"training": {"model": str(model_path(fleet.path, fold))}})


def _replayed(source: str, config: RunConfig, recording: Path, on_progress: OnProgress) -> Outcome:
    """Replay a drive for its recording alone: the fleet's results stay as they are."""
    record = FEWEST if config.output.record == "none" else config.output.record
    with tempfile.TemporaryDirectory(prefix="roadeval-") as reports, staged(source) as path:
        output = OutputSettings(
            save=str(recording), reports=str(Path(reports, "reports")), record=record, figures=False
        )
        return replay(path, replace(config, output=output), on_progress=on_progress)
