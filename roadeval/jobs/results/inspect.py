"""The frames that are worth opening, and the viewer that opens at one of them."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from roadeval.errors import RoadevalError
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.evaluation.score.unlabelled import SIGNS, sign_of
from roadeval.evaluation.tables import finals, only
from roadeval.jobs.outputs import holding
from roadeval.jobs.results.frames import rates_by_frame
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.results.fleet import recording_path, results_path
from roadeval.results.folder import RUN
from roadeval.results.rows import records
from roadeval.results.sentences import notes
from roadeval.runtime.text import visible, without_secrets

LISTED: Final = 10
"""Number of frames that are listed by default."""


@dataclass(frozen=True)
class WorstFrame:
    """One of the worst frames of a drive, or of all drives of a fleet."""

    rank: int
    """The rank; the worst frame has 1."""
    drive: str
    frame: int
    stamp_ns: int
    variant: str
    stage: str
    rates: Mapping[str, float | None]
    """Rates, or the doubt on a frame without truth, see `roadeval.results.schema.TABLES`."""
    by: str = TESTED
    """The rate, or the doubt, that ranks it."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The parts of ERR by stage, see `roadeval.evaluation.tables.causes`; none in a fleet."""
    notes: tuple[str, ...] = ()
    """Sentences on it beside its rates, see `roadeval.results.sentences.notes`."""
    picture: str | None = None
    """The file with the picture of its errors, in a fleet."""
    recording: Path | None = None
    """The drive's recording, if there is one."""
    camera: str = ""
    """The camera that took the frame, in a rig."""


def worst_frames(result: Result, count: int | None = None) -> list[WorstFrame]:
    """Rank the worst frames by ERR of the focus's mask; of each scene only the worst counts.

    If nothing was scored, the frames are ranked by the doubt in the mask; cameras of a rig without
    truth are left out if another camera was scored. In a fleet the frames of all drives are ranked
    together, and by default all ranked frames are returned. A `RoadevalError` if nothing ranks the
    frames, for example if ERR is undefined on every frame.
    """
    if fleet := result.fleet:
        if fleet.worst.empty:
            raise _nothing_scored(fleet.path)
        names = ("rank", "drive", "frame", "stamp_ns", "variant", "stage")
        return [
            WorstFrame(
                **{name: row[name] for name in names},
                rates={name: row[name] for name in (TESTED, "FPR", "FNR")},
                picture=str(fleet.path / row["picture"]) if row["picture"] else None,
                recording=path if path.exists() else None,
            )
            for row in records(fleet.worst[:count])
            for path in [recording_path(fleet.path, row["drive"])]
        ]
    cameras = result.rig or [drive for drive in [result.drive] if drive]
    cameras = [camera for camera in cameras if camera.facts.focus] or cameras
    frames = [frame for camera in cameras for frame in rank_frames(camera, count or LISTED)]
    frames = sorted(frames, key=lambda frame: -(frame.rates[frame.by] or 0.0))[: count or LISTED]
    frames = [replace(frame, rank=rank) for rank, frame in enumerate(frames, 1)]
    if not frames:
        (path,) = result.paths
        if not (focus := cameras[0].facts.focus):
            raise _nothing_scored(path)
        raise RoadevalError(
            f"{path}: ERR of {focus} is undefined on every frame, so no frame is the worst"
        )
    return frames


def rank_frames(
    drive: DriveResult, count: int, among: Collection[int] | None = None
) -> list[WorstFrame]:
    """Rank a drive's frames, or only frames in ``among``; none if ERR is undefined on all."""
    rows, focus, rates = drive.rows, drive.focus, tuple(SHORT)
    if drive.facts.focus is None:
        rows, rates = drive.table("unlabelled"), tuple(SIGNS)
    if focus is None:
        raise _nothing_scored(drive.path)
    masks = finals(only(rows, variant=focus))
    by = TESTED if TESTED in rates else sign_of(masks)
    if by is None:
        return []
    scene_length_ns = tables.scene_ns(rows["stamp_ns"])
    looked_at = masks if among is None else masks[masks["frame"].isin([*among])]
    ranked = tables.worst(looked_at, count, by, scene_length_ns)
    parts: dict[Any, Any] = {}
    rates_of: dict[Any, Any] = {}
    if by == TESTED:
        parts = tables.causes(rows, focus).to_dict("index")
        shown = finals(rows[rows["frame"].isin(ranked["frame"])])
        rates_of = {frame: of_frame for frame, _, of_frame in rates_by_frame(shown, [*SHORT])}
    return [
        WorstFrame(
            *(rank, drive.name, row["frame"], row["stamp_ns"], focus, row["stage"]),
            rates={rate: row[rate] for rate in rates},
            by=by,
            parts=parts.get(row["frame"], {}),
            notes=tuple(notes(rates_of[row["frame"]], focus)) if by == TESTED else (),
            recording=drive.path if drive.recording else None,
            camera=drive.camera,
        )
        for rank, row in enumerate(records(ranked), 1)
    ]


def drive_of(result: Result, frame: WorstFrame) -> tuple[DriveResult, str]:
    """Return the drive of one of a result's worst frames, and words that name it before a frame.

    A `RoadevalError` if a fleet has not kept its recording, with the command that makes it.
    """
    if fleet := result.fleet:
        drive = frame.drive
        if (path := recording_path(fleet.path, drive)).exists():
            return DriveResult(path), f"{drive}, "
        source = visible(without_secrets(str(fleet.drives.loc[drive, "source"])))
        config = str(results_path(fleet.path, drive) / RUN)
        words = ["roadeval", "replay", source, "--config", config, "--record", "worst:10"]
        words += ["--save", str(path), "--reports", str(Path("reports", drive))]
        raise RoadevalError(f"{drive}: no recording was kept; make it with: {shlex.join(words)}")
    if result.rig:
        camera = next(drive for drive in result.rig if drive.camera == frame.camera)
        return camera, f"{frame.camera}, "
    assert result.drive is not None
    return result.drive, ""


def _nothing_scored(path: Path) -> RoadevalError:
    return RoadevalError(f"{path}: nothing was scored, so no frame is the worst")


def of_rank(result: Result, rank: int) -> WorstFrame:
    """Return the frame of a rank among the worst.

    A `RoadevalError` if there are fewer frames, or `worst_frames` raises one.
    """
    frames = worst_frames(result, rank)
    if rank > len(frames):
        (path,) = result.paths
        raise RoadevalError(
            f"{path}: there is no worst frame number {rank}: {len(frames)} are ranked, the "
            "worst of each scene"
        )
    return frames[-1]


def worst(drive: DriveResult) -> WorstFrame | None:
    """Return the worst frame of the focus that has pictures; None if none was scored."""
    if drive.focus is None:
        return None
    return next(iter(rank_frames(drive, 1, among=drive.pictured)), None)


def without_pictures(drive: DriveResult, frame: int) -> str:
    """Return a sentence if a frame was scored and its pictures were not kept, else ""."""
    if drive.recording is None or frame in {*drive.pictured} or frame not in {*drive.rows["frame"]}:
        return ""
    return f"the recording has no pictures of frame {frame}, so the views of them are empty"


def view(drive: DriveResult, frame: int | None, picture: Path | None = None) -> int | None:
    """Open the viewer at a frame, or draw it into a PNG file; return the frame that it drew.

    Without a frame it opens at the first evaluated one that has pictures. A `RoadevalError` if
    there is no recording or no such frame in it, or the viewer cannot work here.
    """
    from roadeval.recording import viewer

    recording = drive.recording
    if recording is None:
        raise RoadevalError(
            f"{drive.path}: a results folder holds no pictures; give the recording (.rrd)"
        )
    counted = {*drive.rows["frame"]}
    numbers = sorted({*drive.pictured, *counted})
    if frame is not None and frame not in numbers:
        held = f"frames {numbers[0]} to {numbers[-1]}" if numbers else "none"
        raise RoadevalError(f"{drive.path}: no frame {frame}; the recording holds {held}")
    if frame is None:
        begin = recording.layout.first_frame
        evaluated = [number for number in drive.pictured if number in counted]
        later = [number for number in drive.pictured if number >= (begin or 0)]
        frame = next(iter([*evaluated, *later, *drive.pictured]), begin)
    if picture is None:
        viewer.show(recording.path, frame)
        return frame
    with holding(picture, inputs=[drive.path]):
        return viewer.screenshot(recording.path, picture, frame)
