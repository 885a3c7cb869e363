"""One drive of a fleet, replayed in a worker process: its results, and its record."""

from __future__ import annotations

import errno
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from roadeval import logs
from roadeval.config import ExecutionSettings, OutputSettings, RunConfig
from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry
from roadeval.fleet.errors import FleetError
from roadeval.fleet.remote import staged, stamp
from roadeval.jobs.fleet_frames import FrameGatherer
from roadeval.jobs.identity import asked
from roadeval.jobs.replay import replay
from roadeval.results.fleet.record import (
    FAILED,
    RESULTS,
    Record,
    read_record,
    record_path,
    recording_path,
)
from roadeval.results.rows import Key, cells, drive_row
from roadeval.results.schema import ALL, TABLES
from roadeval.runtime import memory
from roadeval.runtime.claims import claimed
from roadeval.version import VERSION

PATIENCE_S: Final = 0.5
"""Between two looks whether another command has ended with a drive."""
_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})


@dataclass(frozen=True, slots=True)
class DriveTask:
    """The task of a worker that replays a drive; travels to another process.

    Parameters
    ----------
    folder
        Of the fleet: the same path for every worker.
    entry
        The drive.
    config
        Of this drive, its model included.
    model
        SHA-256 of the model file; empty where the drive trains its own.
    fold
        Whose model that is; None without folds.
    recorded, required
        Whether a recording is made, and whether a drive without one is not done.
    retry
        Whether a drive that has failed is tried again.
    version
        Of the program that asks.
    """

    folder: Path
    entry: DriveEntry
    config: RunConfig
    model: str = ""
    fold: int | None = None
    recorded: bool = False
    required: bool = False
    retry: bool = False
    version: str = VERSION

    @property
    def asked(self) -> str:
        """Digest of settings, model, version, and sizes and times of masks beside the log."""
        masks = {name: logs.mask_stamp(own) for name, own in self.config.masks.items()}
        return asked(self.config, self.model, of=str(self.fold), masks=masks)


@dataclass(frozen=True, slots=True)
class Done:
    """The report of a drive that is done, to the command that replays the fleet.

    ``asked`` is what its record was made for, ``err`` the ERR by which the worst drives are kept;
    None where nothing was scored. ``repeated`` tells that the drive was done before.
    """

    drive: str
    status: str
    reason: str
    frames: int
    asked: str
    err: float | None
    repeated: bool = False


def replay_drive(task: DriveTask) -> Done:
    """Replay a drive and write its record, unless that stands there already.

    While another command works on the same drive, this one waits for it.

    Raises
    ------
    FleetError
        If the fleet's folder cannot be written to, or the worker is of another version: whatever
        is wrong with the drive itself is in its record.
    """
    if task.version != VERSION:
        raise FleetError(
            f"a worker has roadeval {VERSION}, and the command {task.version}: "
            "install the same version everywhere"
        )
    try:
        with _alone(task):
            record = standing(task) or _touched(task)
            if record is not None:
                return done(record, repeated=True)
            record = _made(task)
            record.write(task.folder)
            _attempts(task).unlink(missing_ok=True)
            return done(record)
    except OSError as error:
        raise FleetError(f"{task.folder}: cannot be written: {error.strerror}") from error


def standing(task: DriveTask) -> Record | None:
    """Return the record of a drive that needs not be replayed: it is whole, and nothing changed."""
    record = _usable(task)
    return record if record and record.stamp == _stamp(task.entry) else None


def _usable(task: DriveTask) -> Record | None:
    """Return the record of a drive that needs not be replayed if its log is the same."""
    record = read_record(task.folder, task.entry.id)
    if record is None or record.asked != task.asked or not record.is_whole(task.folder):
        return None
    if record.failed and task.retry:
        return None
    lacking = task.required and not recording_path(task.folder, record.drive).exists()
    return None if lacking and record.value("evaluated") else record


def _touched(task: DriveTask) -> Record | None:
    """Return the record of a drive whose log looks changed and has the same content."""
    record, path = _usable(task), task.entry.path
    if record is None or record.failed or path is None:
        return None
    try:
        with logs.open_log(path) as log:
            same = log.sha256 == record.value("sha256")
    except RoadevalError:
        return None  # what is wrong turns out where it is replayed
    if not same:
        return None
    record = replace(record, stamp=_stamp(task.entry))
    record.write(task.folder)
    return record


def done(record: Record, *, repeated: bool = False) -> Done:
    """Return what the fleet's command is told of a record."""
    names = ("status", "reason", "evaluated")
    status, reason, frames = (record.value(name) for name in names)
    found = status, reason or "", frames or 0, record.asked
    return Done(record.drive, *found, _err(record), repeated)


def failed(task: DriveTask, reason: str, exit_code: int = 1) -> Record:
    """Return the record of a drive that could not be used."""
    row = {
        "name": task.entry.name,
        "source": task.entry.shown,
        "status": FAILED,
        "exit_code": exit_code,
        "reason": reason,
        "attempts": _begun(task),
        "fold": task.fold,
        "model": task.model or None,
    }
    drives = cells("drives", Key(task.entry.id, ""), [row])
    rows = {"drives": drives, "scores": [], "effects": [], "worst": []}
    return Record(task.entry.id, task.asked, _stamp(task.entry), rows)


def _err(record: Record) -> float | None:
    """Return the mean ERR of the first variant's final mask; None where it has none."""
    names = TABLES["scores"].names
    rows = (dict(zip(names, row, strict=True)) for row in record.rows["scores"])
    return next((row["ERR"] for row in rows if row["final"] and row["region"] == ALL), None)


def _stamp(entry: DriveEntry) -> Mapping[str, Any] | None:
    try:
        return stamp(entry.source)
    except RoadevalError:
        return None  # what is wrong turns out where it is read


def _attempts(task: DriveTask) -> Path:
    """Return the file that tells how often a drive was begun since it was last done."""
    return record_path(task.folder, task.entry.id).with_suffix(".begun")


def _begun(task: DriveTask) -> int:
    try:
        return int(_attempts(task).read_text())
    except (OSError, ValueError):
        return 0


def _full(error: BaseException | None) -> str | None:
    """Return why the fleet's disk fails, which would fail every drive; None if it does not."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FULL:
            return error.strerror
        error = error.__cause__
    return None


@contextmanager
def _alone(task: DriveTask) -> Iterator[None]:
    """Hold a drive of the folder, when whoever has it has ended."""
    path = record_path(task.folder, task.entry.id)
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        try:
            with claimed(path, path.parent):
                yield
                return
        except BlockingIOError:
            time.sleep(PATIENCE_S)


def _made(task: DriveTask) -> Record:
    """Replay a drive; whatever is wrong with it becomes its record.

    An OSError or FleetError where the fleet's own disk fails.
    """
    _attempts(task).write_text(str(_begun(task) + 1))
    try:
        return _replayed(task)
    except Exception as error:
        if reason := _full(error):
            raise FleetError(
                f"{task.folder}: cannot be written: {reason}; what is done is kept, and the same "
                "command again does the rest"
            ) from error
        known = isinstance(error, RoadevalError) or memory.is_lacking(error)
        said = memory.LACKING if memory.is_lacking(error) else " ".join(str(error).split())
        reason = said if known else f"{type(error).__name__}: {said} (a defect of roadeval)"
        return failed(task, reason, 1 if known else 70)


def _replayed(task: DriveTask) -> Record:
    memory.forget_peak()
    started, before = time.perf_counter(), _stamp(task.entry)
    drive, folder, wanted = task.entry.id, task.folder, task.asked
    results = folder / RESULTS / drive
    with staged(task.entry.source) as path, FrameGatherer(folder, drive) as gatherer:
        outcome = replay(path, _config(task, results), on_frame=gatherer.add)
        size = sum(each.stat().st_size for each in ([path] if path.is_file() else path.iterdir()))
        gatherer.finish()
    key = Key(drive, outcome.summary["drive"]["camera"])
    row = (
        drive_row(outcome.summary, task.entry.name, task.entry.shown)
        | gatherer.facts()
        | {
            "fold": task.fold,
            "model": task.model or None,
            "identity": _identity(task, outcome.summary),
            "size_bytes": size,
            "attempts": _begun(task),
            "seconds": time.perf_counter() - started,
            "peak_memory_mib": memory.peak_mib(),
        }
    )
    own = {"drives": [row], **outcome.rows, "worst": [*gatherer.worst_rows()]}
    rows = {table: cells(table, key, each) for table, each in own.items()}
    return Record(drive, wanted, before, rows)


def _identity(task: DriveTask, summary: Mapping[str, Any]) -> str:
    """Return the digest of all that decided what a replay found."""
    masks = {name: each["sha256"] for name, each in summary.get("masks", {}).items()}
    return asked(task.config, task.model, of=summary["log"]["sha256"], masks=masks)


def _config(task: DriveTask, results: Path) -> RunConfig:
    """Return the configuration of the replay: one thread, its outputs in the fleet's folder."""
    record = task.config.output.record if task.recorded else "none"
    output = OutputSettings(
        save=str(recording_path(task.folder, task.entry.id)) if record != "none" else None,
        reports=str(results),
        record=record,
        figures=False,
    )
    return replace(task.config, drives=(), output=output, run=ExecutionSettings(jobs=1))
