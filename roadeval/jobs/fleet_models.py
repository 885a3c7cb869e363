"""The models of a fleet's folds: each learns from drives of the other folds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.data import Frame
from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry
from roadeval.fleet.errors import FleetError
from roadeval.fleet.remote import staged, stamp
from roadeval.jobs.identity import asked
from roadeval.results.summary import json_text
from roadeval.runtime.files import put
from roadeval.training import TrainingError, learning, save_model
from roadeval.training.held import HeldFrames

MODELS = "models"


def model_path(folder: Path, fold: int) -> Path:
    """Return the file of a fold's model in a fleet's folder."""
    return folder / MODELS / f"fold_{fold}.model"


TRAINING_DRIVES: Final = 20
"""Drives that the model of a fold learns from, at most; drawn by ``training.seed``, groups in turn.
Their training frames are held decoded."""


@dataclass(frozen=True, slots=True)
class FoldTask:
    """The task of a worker that trains the model of a fold.

    Parameters
    ----------
    folder
        Of the fleet.
    fold
        Whose drives the model will score.
    candidates
        Drives of the other folds, with their configurations, in the order in which they are asked.
    config
        Of the fleet.
    """

    folder: Path
    fold: int
    candidates: tuple[tuple[DriveEntry, RunConfig], ...]
    config: RunConfig

    @property
    def path(self) -> Path:
        """The model file."""
        return model_path(self.folder, self.fold)

    @property
    def about(self) -> Path:
        """The file that tells what the model learnt from."""
        return self.path.with_suffix(".json")


@dataclass(frozen=True, slots=True)
class FoldModel:
    """The model of a fold.

    Parameters
    ----------
    fold
        Whose drives it will score.
    sha256
        Of its file; empty where there is none.
    problem
        Why there is none.
    """

    fold: int
    sha256: str
    problem: str = ""


def train_fold(task: FoldTask) -> FoldModel:
    """Train the model of a fold, unless it is there and nothing has changed.

    A drive without truth, or one that cannot be used, is passed by, and the next one is asked.

    Raises
    ------
    FleetError
        If the model cannot be written.
    """
    try:
        return _trained(task)
    except OSError as error:
        raise FleetError(f"{task.folder}: cannot be written: {error.strerror}") from error


def _trained(task: FoldTask) -> FoldModel:
    wanted = _wanted(task)
    standing = _standing(task, wanted)
    if standing is not None:
        return standing
    settings = task.config.training
    drawn, passed = _drawn(task)
    if not drawn:
        return FoldModel(task.fold, "", _none(task, passed))
    try:
        model = learning.from_drives(drawn, task.config.pipelines(), settings)
        task.path.parent.mkdir(parents=True, exist_ok=True)
        save_model(model, task.path)
    except TrainingError as error:
        return FoldModel(task.fold, "", str(error))
    digest = hashlib.sha256(task.path.read_bytes()).hexdigest()
    about = {
        "fold": task.fold,
        "asked": wanted,
        "sha256": digest,
        "drives": {path.name: len(frames) for path, frames in drawn.items()},
        "passed_by": passed,
        "training_frames": sorted(model.digests),
    }
    put(task.about, json_text(about).encode())
    return FoldModel(task.fold, digest)


def _wanted(task: FoldTask) -> str:
    """Return the digest of all that decides the model."""
    parts: list[Any] = [asked(task.config, "")]
    for entry, own in task.candidates:
        try:
            parts.append([entry.id, asked(own, ""), dict(stamp(entry.source))])
        except RoadevalError:
            parts.append([entry.id, None])
    return hashlib.blake2b(json.dumps(parts).encode(), digest_size=16).hexdigest()


def _standing(task: FoldTask, wanted: str) -> FoldModel | None:
    try:
        about = json.loads(task.about.read_bytes())
        content = task.path.read_bytes()
    except (OSError, ValueError):
        return None
    digest = hashlib.sha256(content).hexdigest()
    if not isinstance(about, dict) or (about.get("asked"), about.get("sha256")) != (wanted, digest):
        return None
    return FoldModel(task.fold, digest)


def _drawn(task: FoldTask) -> tuple[dict[Path, Sequence[Frame]], dict[str, str]]:
    """Return the training frames of as many drives as are wanted, and why others gave none."""
    held = HeldFrames()
    drawn: dict[Path, Sequence[Frame]] = {}
    passed: dict[str, str] = {}
    for entry, own in task.candidates:
        if len(drawn) == TRAINING_DRIVES or held.is_full:
            break
        try:
            frames = list(_frames_of(entry, own, held))
        except RoadevalError as error:
            passed[entry.id] = " ".join(str(error).split())
            continue
        if frames:
            drawn[Path(entry.id)] = frames
        else:
            passed[entry.id] = "no frame with truth"
    return drawn, passed


def _frames_of(entry: DriveEntry, own: RunConfig, held: HeldFrames) -> Iterator[Frame]:
    """Decode the training frames of a drive, and hold them as long as there is room."""
    with staged(entry.source) as path, logs.open_log(path, replace(own, masks={})) as log:
        selection = log.select()
        if selection.truth is None:
            return
        begin = partial(log.frames, selection)
        for frame in learning.spread(begin, own.training.frames, labelled=True):
            if frame.truth is None:
                return
            if not held.add(frame):
                return
            yield frame


def _none(task: FoldTask, passed: dict[str, str]) -> str:
    reasons = sorted(set(passed.values()))
    why = f": {reasons[0]}" if reasons else ""
    return (
        f"the model of fold {task.fold} could not be trained: none of the {len(task.candidates)} "
        f"drives of the other folds gives training frames{why}"
    )
