"""The work of a fleet's workers: a drive replayed to its record, a model trained for a fold."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.config.run import RunConfig
from roadeval.config.settings import FleetSettings, OutputSettings
from roadeval.data import BASELINE, ERRORS, Frame, FrameResult, Role, Tally
from roadeval.errors import RoadevalError
from roadeval.evaluation.score import final_stages
from roadeval.fleet.drives import DriveEntry, FleetError
from roadeval.fleet.remote import stamp
from roadeval.jobs.run.prepared import asked, software
from roadeval.jobs.run.replay import replay
from roadeval.jobs.run.train import draw
from roadeval.logs.truth.labels import label_files
from roadeval.recording.layout import RecordingError
from roadeval.report.images import LayerImage, jpeg, shrink
from roadeval.results.facts import json_text
from roadeval.results.fleet import (
    FRAMES,
    PICTURES,
    RECORDINGS,
    RESULTS,
    Record,
    frames_path,
    is_final,
    read_record,
    record_path,
    recording_path,
    results_path,
)
from roadeval.results.rows import Key, cells, drive_row, frame_rows
from roadeval.results.schema import FAILED
from roadeval.results.tables import TableFile
from roadeval.runtime import memory
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import alone, own_names, put, sha256_of
from roadeval.training import learning
from roadeval.training.learning import HeldFrames, TrainingError
from roadeval.training.model import save_model

MODELS: Final = "models"
TRAINING_DRIVES: Final = 20
"""Drives that the model of a fold learns from, at most; drawn by ``training.seed``, groups in turn.
Their training frames are held decoded."""
FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})


@dataclass(frozen=True)
class DriveTask:
    """The task of a worker that replays a drive; travels to another process."""

    folder: Path
    """The fleet's: the same path for every worker."""
    entry: DriveEntry
    config: RunConfig
    """Of this drive, its model included."""
    software: Mapping[str, str]
    """That of the program that asks, see `roadeval.jobs.run.prepared.software`."""
    model: str = ""
    """SHA-256 of the model file; empty where the drive trains its own."""
    fold: int | None = None
    """Whose model that is; None without folds."""
    required: bool = False
    """Whether a drive without a recording is not done."""

    @property
    def asked(self) -> str:
        """Digest of settings, software and model."""
        return asked(self.config, self.model, self.fold)


@dataclass(frozen=True)
class Done:
    """The report of a drive that is done, to the command that replays the fleet."""

    drive: str
    status: str
    reason: str
    asked: str
    """What its record was made for."""
    err: float | None
    """The ERR by which the worst drives are kept; None where nothing was scored."""
    repeated: bool = False
    """Whether the drive was done before."""


def replay_drive(task: DriveTask) -> Done:
    """Replay a drive and write its record, unless it is there already.

    While another command works on the same drive, this one waits for it. A `FleetError` if the
    fleet's disk fails, or the worker has other software: any problem of the drive itself is in its
    record.
    """
    _check(task.software, task.config)
    model = task.config.training.model
    if task.model and sha256_of(Path(model or "")) != task.model:
        raise FleetError(f"{model}: has changed since the command began; give it again")
    own = [record_path(task.folder, task.entry.id), frames_path(task.folder, task.entry.id)]
    with ending_the_run(task.folder), alone(*own):
        record, repeated = valid_record(task), True
        if record is None:
            record, repeated = _made(task), False
            record.write(task.folder)
        return done(record, repeated=repeated)


def valid_record(task: DriveTask) -> Record | None:
    """Return the record of a drive that needs not be replayed: it is whole, and nothing changed."""
    record = read_record(task.folder, task.entry.id)
    if record is None or record.failed or record.asked != task.asked:
        return None
    if not record.is_whole(task.folder):
        return None
    if task.required and not recording_path(task.folder, record.drive).exists():
        return None
    now = seen(task.entry, task.config)
    return record if now is not None and record.stamp == now else None


def done(record: Record, *, repeated: bool = False) -> Done:
    """Return what a record says to the fleet's command."""
    # The mean ERR of the first variant's final mask.
    err = next((row["ERR"] for row in record.table("scores") if is_final(row)), None)
    status, reason = record.value("status"), record.value("reason") or ""
    return Done(record.drive, status, reason, record.asked, err, repeated)


def failed(task: DriveTask, reason: str, exit_code: int = 1) -> Record:
    """Return the record of a drive that could not be used; what replays have left of it goes."""
    _remove(task, RESULTS, FRAMES, PICTURES, RECORDINGS)
    row = {
        "name": task.entry.name,
        "source": task.entry.shown,
        "status": FAILED,
        "exit_code": exit_code,
        "reason": reason,
        "fold": task.fold,
        "model": task.model or None,
    }
    drives = cells("drives", Key(task.entry.id, ""), [row])
    rows = {"drives": drives, "scores": [], "effects": [], "worst": []}
    return Record(task.entry.id, task.asked, seen(task.entry, task.config), rows)


def seen(entry: DriveEntry, config: RunConfig) -> dict[str, Any] | None:
    """Return what shows at little cost that a drive's log, or masks beside it, did not change.

    Plain data by file: size and times, or of a URL size and tag. None where it cannot be looked at:
    the error is reported where it is read.
    """
    beside = [own for own in (config.truth, *config.masks.values()) if own.path]
    try:
        files = [file for own in beside for file in label_files(own)]
        found: dict[str, Any] = {}
        if entry.path is None:
            size, tag = stamp(entry.source, config.run.patience_s)
            # Without a tag nothing shows: it is equal to no other.
            found[entry.id] = [size, tag or secrets.token_hex()]
        else:
            files += sorted(entry.path.iterdir()) if entry.path.is_dir() else [entry.path]
        facts = {str(file): file.stat() for file in files}
        return found | {n: [f.st_size, f.st_mtime_ns, f.st_ctime_ns] for n, f in facts.items()}
    except (OSError, RoadevalError):
        return None


def _check(asking: Mapping[str, str], config: RunConfig) -> None:
    """Raise a FleetError if a worker's software is not that of the command."""
    own = software(config)
    for name in sorted(asking.keys() | own.keys()):
        mine, theirs = own.get(name, "none"), asking.get(name, "none")
        if mine != theirs:
            raise FleetError(
                f"a worker has {name} {mine[:12]}, and the command {theirs[:12]}: install the same "
                "everywhere, and start the workers again"
            )


def _made(task: DriveTask) -> Record:
    """Return a drive's record; whatever is wrong with the drive stands in it."""
    before = seen(task.entry, task.config)
    try:
        return _replayed(task, before)
    except Exception as error:
        if _disk_failure(error):
            raise
        known = isinstance(error, RoadevalError) or memory.is_lacking(error)
        said = memory.LACKING if memory.is_lacking(error) else " ".join(str(error).split())
        reason = said if known else f"{type(error).__name__}: {said} (a defect of roadeval)"
        return failed(task, reason, 1 if known else 70)


def _replayed(task: DriveTask, before: Mapping[str, Any] | None) -> Record:
    started = time.perf_counter()
    drive, folder = task.entry.id, task.folder
    record = task.config.output.record if task.config.fleet.keep != "none" else "none"
    output = OutputSettings(
        save=str(recording_path(folder, drive)) if record != "none" else None,
        reports=str(results_path(folder, drive)),
        record=record,
        figures=False,
    )
    own_config = replace(
        task.config, output=output, run=replace(task.config.run, jobs=1), fleet=FleetSettings()
    )
    with TableFile(frames_path(folder, drive), "frames") as table:
        gatherer = FrameGatherer(folder, drive, table)
        outcome = replay(task.entry.source, own_config, on_frame=gatherer.add)
        _remove(task, PICTURES, *([RECORDINGS] if record == "none" else []))
        times, worst = gatherer.finish()
    if not outcome.facts.frames.evaluated:
        _remove(task, FRAMES)
    row = {
        **drive_row(outcome.facts, task.entry.name, task.entry.shown),
        **times,
        "fold": task.fold,
        "model": task.model or None,
        "seconds": time.perf_counter() - started,
    }
    own = {"drives": [row], **outcome.rows, "worst": worst}
    key = Key(drive, outcome.facts.drive.camera)
    rows = {table: cells(table, key, each) for table, each in own.items()}
    return Record(drive, task.asked, before, rows)


def _remove(task: DriveTask, *folders: str) -> None:
    """Remove what earlier replays, of something else, have left of a drive in some folders."""
    folder, drive = task.folder, task.entry.id
    recording = recording_path(folder, drive)
    paths = {
        RESULTS: results_path(folder, drive),
        FRAMES: frames_path(folder, drive).parent,
        PICTURES: folder / PICTURES / drive,
        RECORDINGS: recording,
    }
    partial = own_names(recording, hidden=False) if recording.parent.exists() else []
    for path in (*(paths[each] for each in folders), *(partial if RECORDINGS in folders else ())):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


@contextmanager
def ending_the_run(folder: Path) -> Iterator[None]:
    """Turn what fails because of the fleet's disk, as every drive would, into a FleetError."""
    try:
        yield
    except FleetError:
        raise
    except Exception as error:
        failure = error if isinstance(error, OSError) else _disk_failure(error)
        if failure is None:
            raise
        reason = (
            f"{folder}: cannot be written: {os.strerror(failure.errno or errno.EIO)}"
            if isinstance(failure, OSError)
            else str(failure)
        )
        raise FleetError(
            f"{reason}; what is done is kept, and the same command again does the rest"
        ) from error


def _disk_failure(error: BaseException | None) -> BaseException | None:
    """Return the error that says that nothing can be written any more; None if none does."""
    while error is not None:
        full = isinstance(error, OSError) and error.errno in FULL
        if full or (isinstance(error, RecordingError) and isinstance(error.__cause__, OSError)):
            return error
        error = error.__cause__
    return None


@dataclass(frozen=True)
class FoldTask:
    """The task of a worker that trains the model of a fold."""

    folder: Path
    fold: int
    """Whose drives the model will score."""
    candidates: tuple[tuple[DriveEntry, RunConfig], ...]
    """Drives of the other folds, with their configurations, in the order of being asked."""
    config: RunConfig
    software: Mapping[str, str]
    """That of the program that asks."""

    @property
    def path(self) -> Path:
        """The model file."""
        return self.folder / MODELS / f"fold_{self.fold}.model"


@dataclass(frozen=True)
class FoldModel:
    """The model of a fold."""

    fold: int
    """Whose drives it will score."""
    sha256: str
    """Of its file; empty where there is none."""
    problem: str = ""


def train_fold(task: FoldTask) -> FoldModel:
    """Train the model of a fold, unless it is there and nothing has changed.

    A drive without truth, or one that cannot be used, is passed by, and the next one is asked. A
    `FleetError` if the fleet's disk fails, or the worker has other software.
    """
    _check(task.software, task.config)
    about = task.path.with_suffix(".json")
    with ending_the_run(task.folder), alone(task.path, about):
        looks = [seen(entry, own.for_training()) for entry, own in task.candidates]
        parts = [asked(task.config, ""), looks]
        parts += [[entry.id, asked(own, "")] for entry, own in task.candidates]
        wanted = hashlib.blake2b(json.dumps(parts).encode(), digest_size=16).hexdigest()
        return _trained_before(task, about, wanted) or _trained(task, about, wanted)


def _trained_before(task: FoldTask, about: Path, wanted: str) -> FoldModel | None:
    try:
        told = read_json(read_bounded(about))
        digest = sha256_of(task.path)
    except (OSError, ValueError):
        return None
    if not isinstance(told, dict) or (told.get("asked"), told.get("sha256")) != (wanted, digest):
        return None
    return FoldModel(task.fold, digest)


def _trained(task: FoldTask, about: Path, wanted: str) -> FoldModel:
    drawn, passed = _drawn(task)
    if not drawn:
        why = f": {min(passed.values())}" if passed else ""
        return FoldModel(
            task.fold,
            "",
            f"the model of fold {task.fold} could not be trained: none of the "
            f"{len(task.candidates)} drives of the other folds gives training frames{why}",
        )
    try:
        model = learning.from_drives(drawn, task.config.pipelines(), task.config.training)
    except TrainingError as error:
        return FoldModel(task.fold, "", str(error))
    save_model(model, task.path)
    digest = sha256_of(task.path)
    told = {
        "fold": task.fold,
        "asked": wanted,
        "sha256": digest,
        "drives": {path.name: len(frames) for path, frames in drawn.items()},
        "passed_by": passed,
        "training_frames": sorted(model.digests),
    }
    put(about, json_text(told).encode())
    return FoldModel(task.fold, digest)


def _drawn(task: FoldTask) -> tuple[dict[Path, Sequence[Frame]], dict[str, str]]:
    """Return the training frames of as many drives as are wanted, and why others gave none."""
    held = HeldFrames()
    drawn: dict[Path, Sequence[Frame]] = {}
    passed: dict[str, str] = {}
    for entry, own in task.candidates:
        if len(drawn) == TRAINING_DRIVES:
            break
        try:
            frames, _ = draw(entry, own, held, labelled=True)
        except RoadevalError as error:
            if _disk_failure(error):
                raise
            passed[entry.id] = " ".join(str(error).split())
            continue
        if frames:
            drawn[Path(entry.id)] = frames
        else:
            passed[entry.id] = "no frame with truth"
    return drawn, passed


WORST: Final = 3
"""Frames of a drive that are kept as its worst."""
APART_NS: Final = 1_000_000_000
"""Neighbours fail alike: of frames less than this apart only the worst is kept."""
WIDTH: Final = 320
"""Pixels across their pictures."""


class FrameGatherer:
    """Takes a drive's frames in order: their rows into a table, and keeps the worst of them."""

    def __init__(self, folder: Path, drive: str, table: TableFile) -> None:
        self._folder: Final = folder
        self._drive: Final = drive
        self._table: Final = table
        self._stamps: list[int] = []
        """Of the first and the last evaluated frame."""
        self._worst: list[tuple[dict[str, Any], bytes]] = []
        """Rows of the table ``worst`` without their ranks, and the pictures."""

    def add(self, result: FrameResult) -> None:
        """Add a frame; one that was not evaluated is ignored."""
        if result.role is not Role.EVALUATED:
            return
        self._stamps = [*self._stamps[:1], result.frame.stamp_ns]
        key = self._drive, result.frame.camera
        stages = final_stages((tally.variant, tally.stage) for tally in result.tallies)
        self._table.add(
            (*key, *row, stages[tally.variant] == tally.stage)
            for tally, row in zip(result.tallies, frame_rows(result)["frames"], strict=True)
        )
        first = next((t.variant for t in result.tallies if t.variant != BASELINE), None)
        if first is not None:
            *_, final = (tally for tally in result.tallies if tally.variant == first)
            self._offer(result, final)

    def _offer(self, result: FrameResult, tally: Tally) -> None:
        """Keep a frame as long as it is one of the worst."""
        frame, err = result.frame, tally.rates["ERR"]
        near = [w for w in self._worst if abs(w[0]["stamp_ns"] - frame.stamp_ns) < APART_NS]
        rest = [w for w in self._worst if w not in near]
        rivals = [*near, *(rest[-1:] if len(rest) == WORST else [])]
        if math.isnan(err) or any(row["ERR"] >= err for row, _ in rivals):
            return
        # Painted when they are small: most are soon replaced by a worse frame's.
        image, errors = shrink(frame.image, WIDTH), result.errors[tally.variant].array
        small = shrink(errors.astype(np.uint8, copy=False), WIDTH, labels=True)
        picture = jpeg(LayerImage("", image, ERRORS, small), WIDTH).content
        row = {
            "frame": frame.number,
            "stamp_ns": frame.stamp_ns,
            "variant": tally.variant,
            "stage": tally.stage,
            **{name: tally.rates[name] for name in ("ERR", "FPR", "FNR")},
            "picture": Path(PICTURES, self._drive, f"{frame.number}.jpg").as_posix(),
        }
        ranked = sorted([*rest, (row, picture)], key=lambda w: (-w[0]["ERR"], w[0]["frame"]))
        self._worst = ranked[:WORST]

    def finish(self) -> tuple[dict[str, int], list[dict[str, Any]]]:
        """Finish the table, write the worst frames' pictures; return when frames are, and which.

        The cells of a drive's row on its first and last evaluated frame, and the rows of ``worst``,
        whose ranks are given over all drives later. An OSError if a file cannot be written.
        """
        times = {}
        if self._stamps:
            self._table.finish()
            times = {"start_ns": self._stamps[0], "end_ns": self._stamps[-1]}
        for row, picture in self._worst:
            put(self._folder / row["picture"], picture)
        rows = [{"rank": rank, **row} for rank, (row, _) in enumerate(self._worst, 1)]
        return times, rows
