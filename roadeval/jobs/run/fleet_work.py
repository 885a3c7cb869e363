"""The work of a fleet's workers: replay a drive, or train the model of a fold."""

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
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.config.run import RunConfig
from roadeval.config.settings import FleetSettings, OutputSettings
from roadeval.data import ERRORS, Frame, FrameResult
from roadeval.errors import RoadevalError
from roadeval.evaluation.metrics import TESTED
from roadeval.fleet.drives import DriveEntry, FleetError
from roadeval.fleet.remote import stamp
from roadeval.jobs.run.prepared import settings_digest, software
from roadeval.jobs.run.replay import replay
from roadeval.jobs.run.train import training_frames
from roadeval.logs.truth.meaning import label_files
from roadeval.recording.layout import RecordingError
from roadeval.report.images import LayerImage, jpeg, shrink
from roadeval.results.facts import DRIVE_RESULTS, SUMMARY, Facts, focus_of, json_text
from roadeval.results.fleet import (
    APART_NS,
    CACHED,
    OF_A_DRIVE,
    PICTURES,
    RECORDINGS,
    Made,
    cache,
    cached_path,
    made_path,
    read_made,
    recording_path,
    results_path,
)
from roadeval.results.rows import drive_row
from roadeval.results.schema import FAILED
from roadeval.runtime import memory
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import claim_files, find_partial, put, sha256_of
from roadeval.training import learning
from roadeval.training.learning import HeldFrames, TrainingError
from roadeval.training.model import save_model

MODELS: Final = "models"
TRAINING_DRIVES: Final = 20
"""Greatest number of drives that the model of a fold learns from, drawn by ``training.seed`` from
the groups in turn. Their decoded training frames stay in memory."""
FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})


@dataclass(frozen=True)
class DriveTask:
    """The task of a worker that replays a drive; it travels to another process."""

    folder: Path
    """The fleet's folder, which has the same path for every worker."""
    entry: DriveEntry
    config: RunConfig
    """Configuration of this drive, its model included."""
    software: Mapping[str, str]
    """Software of the program that asks, see `roadeval.jobs.run.prepared.software`."""
    model: str = ""
    """SHA-256 of the model file; empty if the drive trains its own model."""
    fold: int | None = None
    """The fold that the model belongs to; None without folds."""

    @property
    def asked(self) -> str:
        """Digest of settings, software and model."""
        return settings_digest(self.config, self.model, self.fold, self.config.output.focus)

    @property
    def focus(self) -> str | None:
        """The variant that was chosen as the focus, if the drive has it."""
        chosen = self.config.output.focus
        return chosen if chosen in self.config.names() else None

    @property
    def record(self) -> str:
        """The rule for pictures to record; a drive without its recording is not done."""
        return self.config.output.record if self.config.fleet.keep == "all" else "none"


@dataclass(frozen=True)
class Done:
    """A worker's report on a drive that is done, for the command that replays the fleet."""

    drive: str
    status: str
    reason: str
    asked: str
    """Digest of settings, software and model, as in its `DriveTask`."""
    repeated: bool = False
    """Whether the drive was done before."""


def replay_drive(task: DriveTask) -> Done:
    """Replay a drive into the fleet's folder, unless it is done already.

    If another command works on the same drive, wait for it. A `FleetError` if the fleet's disk
    fails, or the worker has other software than the command; `Done` names any problem of the drive
    itself.
    """
    _check_software(task.software, task.config)
    model = task.config.training.model
    if task.model and sha256_of(Path(model or "")) != task.model:
        raise FleetError("has changed since the command began", where=model, remedy="give it again")
    with ending_the_run(task.folder), claim_files(made_path(task.folder, task.entry.id)):
        made, repeated = find_valid(task), True
        if made is None:
            made, repeated = _try_replay(task), False
            made.write(task.folder)
        return report_drive(task.folder, made, repeated=repeated)


def find_valid(task: DriveTask) -> Made | None:
    """Return how a complete and unchanged drive was made; None if it must be replayed."""
    made = read_made(task.folder, task.entry.id)
    if made is None or made.problem or made.asked != task.asked:
        return None
    if task.record != "none" and not recording_path(task.folder, made.drive).exists():
        return None
    now = stamp_files(task.entry, task.config)
    return made if now is not None and made.stamp == now else None


def report_drive(folder: Path, made: Made, *, repeated: bool = False) -> Done:
    """Return the report on a drive for the fleet's command."""
    if made.problem:
        return Done(made.drive, FAILED, made.problem, made.asked, repeated)
    row = drive_row(Facts.read(results_path(folder, made.drive) / SUMMARY), "", "")
    return Done(made.drive, row["status"], row["reason"] or "", made.asked, repeated)


def mark_failed(task: DriveTask, reason: str, exit_code: int = 1) -> Made:
    """Remove files of earlier replays of a drive, and return why it could not be used."""
    _remove(task, DRIVE_RESULTS, PICTURES, RECORDINGS, *CACHED)
    stamp = stamp_files(task.entry, task.config)
    how = task.fold, task.model or None
    return Made(task.entry.id, task.asked, stamp, *how, problem=reason, exit_code=exit_code)


def stamp_files(entry: DriveEntry, config: RunConfig) -> dict[str, Any] | None:
    """Return facts that quickly show whether a drive's log, or masks beside it, changed.

    They are size and times of each file, or size and tag behind a URL. None if a file cannot be
    looked at: the error is reported when the drive is read.
    """
    beside = [labels for labels in (config.truth, *config.masks.values()) if labels.path]
    try:
        files = [file for labels in beside for file in label_files(labels)]
        stamps: dict[str, Any] = {}
        if entry.path is None:
            size, tag = stamp(entry.source, config.run.patience_s)
            # Without a tag a change cannot be noticed, so the value is equal to no other.
            stamps[entry.id] = [size, tag or secrets.token_hex()]
        else:
            files += sorted(entry.path.iterdir()) if entry.path.is_dir() else [entry.path]
        facts = {str(file): file.stat() for file in files}
        return stamps | {n: [f.st_size, f.st_mtime_ns, f.st_ctime_ns] for n, f in facts.items()}
    except (OSError, RoadevalError):
        return None


def _check_software(asking: Mapping[str, str], config: RunConfig) -> None:
    """Raise a FleetError if a worker has other software than the command."""
    installed = software(config)
    for name in sorted(asking.keys() | installed.keys()):
        mine, theirs = installed.get(name, "none"), asking.get(name, "none")
        if mine != theirs:
            raise FleetError(
                f"a worker has {name} {mine[:12]}, and the command {theirs[:12]}: install the same "
                "everywhere, and start the workers again"
            )


def _try_replay(task: DriveTask) -> Made:
    """Replay a drive; the result names any problem."""
    stamp, started = stamp_files(task.entry, task.config), time.perf_counter()
    drive, folder, record = task.entry.id, task.folder, task.record
    output = OutputSettings(
        save=str(recording_path(folder, drive)) if record != "none" else None,
        reports=str(results_path(folder, drive)),
        record=record,
        focus=task.focus,
        figures=False,
        packed=True,
        without=task.config.output.without,
    )
    one_process = replace(task.config.run, jobs=1)
    pictures = WorstPictures(task.focus)
    try:
        config = replace(task.config, output=output, run=one_process, fleet=FleetSettings())
        outcome = replay(task.entry.source, config, on_frame=pictures.offer)
        _remove(task, PICTURES, *CACHED, *([RECORDINGS] if record == "none" else []))
        for _, frame, _, picture in pictures.worst:
            put(folder / PICTURES / drive / f"{frame}.jpg", picture)
        if outcome.facts.frames.evaluated:
            cache(folder, drive)
    except Exception as error:
        if _disk_failure(error):
            raise
        is_known = isinstance(error, RoadevalError) or memory.is_lacking(error)
        reason = memory.NOT_ENOUGH if memory.is_lacking(error) else " ".join(str(error).split())
        if not is_known:
            reason = f"{type(error).__name__}: {reason} (a defect of roadeval)"
        return mark_failed(task, reason, 1 if is_known else 70)
    seconds = time.perf_counter() - started
    return Made(task.entry.id, task.asked, stamp, task.fold, task.model or None, seconds=seconds)


def _remove(task: DriveTask, *folders: str) -> None:
    """Remove a drive's files in some folders; replays of other logs or settings left them."""
    folder, drive = task.folder, task.entry.id
    recording = recording_path(folder, drive)
    paths = {
        DRIVE_RESULTS: results_path(folder, drive),
        **{name: cached_path(folder, name, drive).parent for name in CACHED},
        PICTURES: folder / PICTURES / drive,
        RECORDINGS: recording,
    }
    partial = find_partial(recording, hidden=False) if RECORDINGS in folders else []
    for path in (*(paths[name] for name in folders), *partial):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


GO_ON: Final = "what is done is kept, and the same command again does the rest"


@contextmanager
def ending_the_run(folder: Path) -> Iterator[None]:
    """Raise a `FleetError` for an error of the fleet's disk, which would end every drive."""
    try:
        yield
    except FleetError:
        raise
    except Exception as error:
        failure = error if isinstance(error, OSError) else _disk_failure(error)
        if failure is None:
            raise
        if isinstance(failure, OSError):
            problem = f"cannot be written: {os.strerror(failure.errno or errno.EIO)}"
            raise FleetError(problem, where=folder, remedy=GO_ON) from error
        ended = FleetError.of(failure)
        ended.remedy = GO_ON
        raise ended from error


def _disk_failure(error: BaseException | None) -> OSError | RecordingError | None:
    """Return the error in a chain that prevents all writing; None if there is none."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in FULL:
            return error
        if isinstance(error, RecordingError) and isinstance(error.__cause__, OSError):
            return error
        error = error.__cause__
    return None


@dataclass(frozen=True)
class FoldTask:
    """The task of a worker that trains the model of a fold."""

    folder: Path
    fold: int
    """The fold; the model will score its drives."""
    candidates: tuple[tuple[DriveEntry, RunConfig], ...]
    """Drives of the other folds, with their configurations, in the order in which they are
    tried."""
    config: RunConfig
    software: Mapping[str, str]
    """Software of the program that asks."""

    @property
    def path(self) -> Path:
        """The model file."""
        return self.folder / MODELS / f"fold_{self.fold}.model"


def train_fold(task: FoldTask) -> tuple[str, str]:
    """Train the model of a fold, unless it exists and nothing has changed.

    Return the SHA-256 of its file, or an empty text and why there is no model. A drive without
    truth, or one that cannot be used, is skipped, and the next one is tried. A `FleetError` if the
    fleet's disk fails, or the worker has other software.
    """
    _check_software(task.software, task.config)
    facts_file = task.path.with_suffix(".json")
    with ending_the_run(task.folder), claim_files(task.path, facts_file):
        looks = [stamp_files(entry, config.for_training()) for entry, config in task.candidates]
        parts = [settings_digest(task.config, ""), looks]
        parts += [[entry.id, settings_digest(config, "")] for entry, config in task.candidates]
        digest = hashlib.blake2b(json.dumps(parts).encode(), digest_size=16).hexdigest()
        with suppress(OSError, ValueError):
            trained = read_json(read_bounded(facts_file))
            as_asked = {"asked": digest, "sha256": sha256_of(task.path)}
            if isinstance(trained, dict) and as_asked.items() <= trained.items():
                return as_asked["sha256"], ""
        return _train_model(task, facts_file, digest)


def _train_model(task: FoldTask, facts_file: Path, asked_digest: str) -> tuple[str, str]:
    """Train on enough drives; the file beside the model says why others gave no frames."""
    held = HeldFrames()
    drawn: dict[Path, Sequence[Frame]] = {}
    passed: dict[str, str] = {}
    for entry, config in task.candidates:
        if len(drawn) == TRAINING_DRIVES:
            break
        try:
            frames, _ = training_frames(entry, config, held, labelled=True)
        except RoadevalError as error:
            if _disk_failure(error):
                raise
            passed[entry.id] = " ".join(str(error).split())
            continue
        if frames:
            drawn[Path(entry.id)] = frames
        else:
            passed[entry.id] = "no frame with truth"
    if not drawn:
        why = f": {min(passed.values())}" if passed else ""
        others = f"none of the {len(task.candidates)} drives of the other folds"
        problem = f"could not be trained: {others} gives training frames{why}"
        return "", f"the model of fold {task.fold} {problem}"
    try:
        model = learning.from_drives(drawn, task.config.pipelines(), task.config.training)
    except TrainingError as error:
        return "", error.sentence
    save_model(model, task.path)
    digest = sha256_of(task.path)
    about_model = {
        "fold": task.fold,
        "asked": asked_digest,
        "sha256": digest,
        "drives": {path.name: len(frames) for path, frames in drawn.items()},
        "passed_by": passed,
        "training_frames": sorted(model.digests),
    }
    put(facts_file, json_text(about_model).encode())
    return digest, ""


WIDTH: Final = 320
"""Width of the pictures in pixels."""


class WorstPictures:
    """Keeps pictures of the worst frames of a drive, by the final mask of its focus."""

    def __init__(self, focus: str | None) -> None:
        self._focus = focus
        self.worst: list[tuple[float, int, int, bytes]] = []
        """ERR, number, stamp and picture of each kept frame; the worst frame comes first."""

    def offer(self, result: FrameResult) -> None:
        """Keep a frame as long as it is one of the worst; one without a rate is ignored."""
        frame = result.frame
        variant = self._focus or focus_of(tally.variant for tally in result.tallies)
        errors = [t.rates[TESTED] for t in result.tallies if t.variant == variant]
        if variant is None or not errors or math.isnan(error := errors[-1]):
            return
        near = [rival for rival in self.worst if abs(rival[2] - frame.stamp_ns) < APART_NS]
        others = [rival for rival in self.worst if rival not in near]
        rivals = [*near, *(others[-1:] if len(others) == OF_A_DRIVE else [])]
        if any(rival[0] >= error for rival in rivals):
            return
        # Pictures are painted at a small size, because worse frames soon replace most of them.
        image, errors_of = shrink(frame.image, WIDTH), result.errors[variant].array
        small = shrink(errors_of.astype(np.uint8, copy=False), WIDTH, labels=True)
        picture = jpeg(LayerImage("", image, ERRORS, small), WIDTH).content
        ranked = [*others, (error, frame.number, frame.stamp_ns, picture)]
        self.worst = sorted(ranked, key=lambda frame: (-frame[0], frame[1]))[:OF_A_DRIVE]
