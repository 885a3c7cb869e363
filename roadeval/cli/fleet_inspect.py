"""``roadeval inspect`` of a fleet."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from roadeval.cli import console, messages, progress
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.results.fleet.folder import Fleet


@dataclass(frozen=True, slots=True)
class Asked:
    """The options of ``roadeval inspect`` that hold for a fleet."""

    listed: bool
    drive: str | None
    frame: int | None
    worst: int | None
    screenshot: Path | None
    json: bool


def inspect(fleet: Fleet, asked: Asked) -> int:
    """List the worst frames of a fleet, or open one of them, the worst of all by default."""
    if asked.frame is not None and asked.drive is None:
        raise typer.BadParameter("--frame of a fleet needs its drive: --drive ID")
    if asked.drive is not None and asked.worst is not None:
        raise typer.BadParameter("--worst counts over all drives; give it without --drive")
    if asked.listed:
        _list(fleet, asked)
    else:
        _open(fleet, asked)
    return ExitCode.DONE


def _list(fleet: Fleet, asked: Asked) -> None:
    from roadeval.cli.screens import fleet_inspect as screen
    from roadeval.jobs import inspect as of_a_drive
    from roadeval.jobs.fleet_inspect import worst_frames
    from roadeval.results.summary import json_text, plain

    found = worst_frames(fleet, asked.worst or of_a_drive.LISTED)
    if asked.json:
        rows = [asdict(each) | {"picture": str(each.picture)} for each in found]
        paths = [{"recording": each.recording and str(each.recording)} for each in found]
        told = [row | path for row, path in zip(rows, paths, strict=True)]
        console.emit(json_text(plain(told)).rstrip())
    else:
        screen.show(fleet.name, found, console.results())


def _open(fleet: Fleet, asked: Asked) -> None:
    """Open the viewer at a frame, or draw it into a file; the drive is replayed if need be."""
    from roadeval.jobs import fleet_inspect as inspecting
    from roadeval.jobs import inspect as of_a_drive
    from roadeval.jobs.result import DriveResult

    drive, frame = asked.drive, asked.frame
    if drive is None:
        found = inspecting.frame_of_rank(fleet, asked.worst or 1)
        drive, frame = found.drive, found.frame
    with progress.watched() as watch:
        recording, warnings = inspecting.recording_of(fleet, drive, watch, messages.note)
    opened = DriveResult(recording)
    if frame is not None and (said := of_a_drive.without_pictures(opened, frame)):
        messages.warning(said)
    shown = of_a_drive.view(opened, frame, asked.screenshot)
    if asked.screenshot is not None:
        console.emit(f"{asked.screenshot}: {drive}, frame {shown}")
    for warning in (*opened.warnings, *warnings):
        messages.warning(warning)
