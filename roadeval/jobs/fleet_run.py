"""A fleet while it is replayed: the drives that are left, their workers, and the progress."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from roadeval.config import RunConfig
from roadeval.errors import RoadevalError
from roadeval.fleet.copies import groups_of
from roadeval.fleet.engine import ATTEMPTS, died, started
from roadeval.fleet.entry import DriveEntry
from roadeval.fleet.errors import FleetError
from roadeval.fleet.folds import deal, shuffled
from roadeval.jobs.fleet_drive import Done, DriveTask, done, failed, replay_drive, standing
from roadeval.jobs.fleet_models import FoldModel, FoldTask, train_fold
from roadeval.results.fleet.record import FAILED, recording_path


@dataclass(frozen=True, slots=True)
class FleetProgress:
    """How far a fleet is.

    Parameters
    ----------
    done, failed, total
        Drives; those that failed are among those that are done.
    running
        Drives that are being replayed now.
    kept
        Of those done, the drives that an earlier command has done.
    frames
        Evaluated frames of the drives that this command has replayed.
    seconds
        Since the command began.
    stage
        ``looking``, ``training``, ``replaying`` or ``writing``.
    dashboard
        Address of a page that shows the workers, if there is one.
    """

    done: int
    failed: int
    total: int
    running: int
    kept: int
    frames: int
    seconds: float
    stage: str
    dashboard: str | None = None


OnFleetProgress = Callable[[FleetProgress], None]


@dataclass(slots=True)
class FleetRun:
    """A fleet that is being replayed.

    Parameters
    ----------
    folder
        The fleet's.
    entries
        Its drives.
    config
        Every option, those of the fleet included.
    on_progress
        Called in the caller's thread as drives are done.
    retry
        Whether drives that failed before are tried again.
    done
        What is known of each drive that is done, by its ID.
    """

    folder: Path
    entries: tuple[DriveEntry, ...]
    config: RunConfig
    on_progress: OnFleetProgress
    retry: bool
    done: dict[str, Done] = field(default_factory=dict)
    pruned: set[str] = field(default_factory=set)
    workers: int = 1
    dashboard: str | None = None
    began: float = field(default_factory=time.monotonic)

    def replay_all(self, executor: Executor | None) -> None:
        """Replay every drive that is not done."""
        self.show("looking")
        configs = {entry.id: self._of(entry) for entry in self.entries}
        if self.config.fleet.folds is None:
            model = self.config.training.model
            digest = _sha256(model) if model else ""
            tasks = [self._task(e, configs[e.id], digest, None) for e in self.entries]
            waiting = self._waiting(tasks)
            if waiting:
                with self._engine(executor) as engine:
                    self._replay(engine, waiting)
            return
        with self._engine(executor) as engine:
            self._replay(engine, self._waiting(self._by_fold(engine, configs)))

    def show(self, stage: str) -> None:
        """Report the progress to the caller."""
        done = self.done.values()
        left = len(self.entries) - len(done)
        self.on_progress(
            FleetProgress(
                done=len(done),
                failed=sum(each.status == FAILED for each in done),
                total=len(self.entries),
                running=min(left, self.workers) if stage == "replaying" else 0,
                kept=sum(each.repeated for each in done),
                frames=sum(each.frames for each in done if not each.repeated),
                seconds=time.monotonic() - self.began,
                stage=stage,
                dashboard=self.dashboard,
            )
        )

    def _of(self, entry: DriveEntry) -> RunConfig:
        """Return the configuration of a drive: what the manifest says of it comes last."""
        own = self.config.for_drive(entry.source)
        if entry.settings is not None:
            own = own.with_drives([entry.settings]).for_drive(entry.source)
        return replace(own, fleet=type(own.fleet)())

    def _task(self, entry: DriveEntry, own: RunConfig, model: str, fold: int | None) -> DriveTask:
        keep = self.config.fleet.keep
        return DriveTask(
            self.folder,
            entry,
            own,
            model,
            fold,
            recorded=keep != "none",
            required=keep == "all",
            retry=self.retry,
        )

    def _waiting(self, tasks: Sequence[DriveTask]) -> list[DriveTask]:
        """Return the tasks whose drives are not done; a URL is looked at by its worker."""
        waiting = []
        for task in tasks:
            record = standing(task) if task.entry.path is not None else None
            if record is None:
                waiting.append(task)
            else:
                self.done[record.drive] = done(record, repeated=True)
        return waiting

    @contextmanager
    def _engine(self, executor: Executor | None) -> Iterator[Executor]:
        if executor is not None:
            yield executor
            return
        asked = self.config.fleet
        with started(asked.workers, asked.memory_gib, asked.scheduler) as engine:
            self.workers, self.dashboard = engine.workers or 1, engine.dashboard
            yield engine.executor

    def _by_fold(self, engine: Executor, configs: Mapping[str, RunConfig]) -> list[DriveTask]:
        """Train the folds' models, and return the tasks of the drives with them."""
        settings = self.config
        assert settings.fleet.folds is not None
        self.show("looking")
        folds = deal(groups_of(self.entries), settings.fleet.folds, settings.training.seed)
        by_id = {entry.id: entry for entry in self.entries}
        asked = [by_id[drive] for drive in shuffled(by_id, settings.training.seed)]
        training = [
            FoldTask(
                self.folder,
                fold,
                tuple((e, configs[e.id]) for e in asked if folds[e.id] != fold),
                settings,
            )
            for fold in range(settings.fleet.folds)
        ]
        self.show("training")
        futures = [engine.submit(train_fold, task) for task in training]
        made = [self._model(future, fold) for fold, future in enumerate(futures)]
        tasks = []
        for entry in self.entries:
            fold = made[folds[entry.id]]
            own = configs[entry.id].override({"training": {"model": str(training[fold.fold].path)}})
            task = self._task(entry, own, fold.sha256, fold.fold)
            if fold.problem:
                self._fail(task, fold.problem)
            else:
                tasks.append(task)
        return tasks

    def _model(self, future: Future[FoldModel], fold: int) -> FoldModel:
        """Wait for the model of a fold; one that fails fails its drives alone."""
        try:
            return future.result()
        except Exception as error:
            return FoldModel(fold, "", self._reason(error, f"the model of fold {fold} was trained"))

    def _replay(self, engine: Executor, tasks: Sequence[DriveTask]) -> None:
        """Replay the tasks' drives, and take each result as it comes."""
        self.show("replaying")
        waiting = {engine.submit(replay_drive, task): task for task in tasks}
        try:
            for future in as_completed(list(waiting)):
                self._take(future, waiting.pop(future))
                self._prune()
                self.show("replaying")
        finally:
            for future in waiting:
                future.cancel()

    def _take(self, future: Future[Done], task: DriveTask) -> None:
        try:
            found = future.result()
        except Exception as error:
            self._fail(task, self._reason(error, "it was replayed"))
        else:
            self.done[found.drive] = found

    def _reason(self, error: Exception, doing: str) -> str:
        """Return why a task has failed; what ends the whole run is raised."""
        match error:
            case RoadevalError():
                raise error
            case CancelledError():
                raise FleetError(
                    f"{self.folder}: the workers have gone, or their scheduler; what is done is "
                    "kept, and the same command again does the rest"
                ) from error
        if died(error):
            return (
                f"its worker process ended {ATTEMPTS} times while {doing}, as it does where memory "
                "runs out"
            )
        return " ".join(f"{type(error).__name__}: {error}".split())

    def _fail(self, task: DriveTask, reason: str) -> None:
        record = failed(task, reason)
        record.write(self.folder)
        self.done[record.drive] = done(record)

    def _prune(self) -> None:
        """Remove recordings that are not kept, as drives are done: they take the most room."""
        keep = self.config.fleet.keep
        if not keep.startswith("worst:"):
            return
        count = int(keep.removeprefix("worst:"))
        scored = [each for each in self.done.values() if each.err is not None]
        worst = sorted(scored, key=lambda each: (-(each.err or 0), each.drive))[:count]
        # Once dropped a drive stays so, for more are done and none fewer.
        for drive in self.done.keys() - {each.drive for each in worst} - self.pruned:
            self.pruned.add(drive)
            with suppress(OSError):
                recording_path(self.folder, drive).unlink(missing_ok=True)


def _sha256(model: str) -> str:
    try:
        return hashlib.sha256(Path(model).read_bytes()).hexdigest()
    except OSError as error:
        raise FleetError(f"{model}: cannot read the model: {error.strerror}") from error
