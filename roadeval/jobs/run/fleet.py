"""Many drives in one run: each replayed in a worker, its record kept, all records made tables."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from roadeval.config import FleetSettings, RunConfig, run_toml
from roadeval.errors import RoadevalError
from roadeval.fleet.engine import ATTEMPTS, died, started
from roadeval.fleet.entry import (
    DriveEntry,
    FleetError,
    deal,
    groups_of,
    shuffled,
    with_cameras,
)
from roadeval.fleet.sources import find_drives
from roadeval.jobs.run.fleet_work import (
    Done,
    DriveTask,
    FoldModel,
    FoldTask,
    attempts,
    done,
    ending_the_run,
    failed,
    replay_drive,
    train_fold,
    valid_record,
)
from roadeval.jobs.run.prepared import software
from roadeval.results.facts import FleetFacts, Member
from roadeval.results.fleet import FleetWriter, recording_path
from roadeval.results.schema import DAMAGED, FAILED
from roadeval.runtime.files import AnyPath, Paths, listed, sha256_of
from roadeval.version import VERSION


@dataclass(frozen=True, slots=True)
class FleetProgress:
    """How far a fleet is."""

    done: int
    """Drives, those that failed among them."""
    failed: int
    total: int
    running: int
    """Drives that are being replayed now."""
    kept: int
    """Of those done, the drives that an earlier command has done."""
    frames: int
    """Evaluated frames of the drives that this command has replayed."""
    seconds: float
    """Since the command began."""
    stage: str
    """``looking``, ``training``, ``replaying`` or ``writing``."""


OnFleetProgress = Callable[[FleetProgress], None]


@dataclass(frozen=True, slots=True)
class FleetOutcome:
    """The result of replaying a fleet."""

    folder: Path
    counts: Mapping[str, int]
    replayed: int
    """How many of them this command has replayed."""
    problems: Mapping[str, str]
    """Why drives failed, by the drives' names in the fleet."""
    facts: FleetFacts

    @property
    def summary(self) -> dict[str, Any]:
        """The content of ``fleet.json``."""
        return self.facts.as_dict()

    @property
    def lost(self) -> bool:
        """Whether a drive failed, or a part of one was lost."""
        return bool(self.counts.get(FAILED) or self.counts.get(DAMAGED))


def replay_fleet(
    drives: Paths,
    output: AnyPath,
    config: RunConfig | None = None,
    *,
    executor: Executor | None = None,
    retry_failed: bool = False,
    on_progress: OnFleetProgress = lambda _: None,
) -> FleetOutcome:
    """Replay many drives, and write the tables of all of them.

    The folder is the state: a drive whose record is there, made of the same log, settings, model
    and version, is not replayed again. A `RoadevalError` if there is no drive, or the folder or the
    engine cannot be used, or more drives fail than ``fleet.max_failures`` allows: then all that was
    done is kept.

    Parameters
    ----------
    drives
        Logs, rosbag2 folders, folders that are searched, patterns, URLs, and manifests: see
        `roadeval.fleet.sources.find_drives`.
    output
        The fleet's folder, which the workers must see under the same path.
    config
        Every option, those of the fleet included (`RunConfig.fleet`).
    executor
        Who replays the drives; by default Dask's workers, as `RunConfig.fleet` says.
    retry_failed
        Whether drives that failed before are tried again.
    on_progress
        Called in the caller's thread as drives are done.
    """
    config = (config or RunConfig()).resolved()
    entries = find_drives([str(drive) for drive in listed(drives)])
    if config.cameras:
        entries = with_cameras(entries, config.cameras)
        config = replace(config, cameras=())
    if config.fleet.folds is not None and config.training.model is not None:
        raise FleetError(
            "`fleet.folds` and `training.model` do not go together: folds train models"
        )
    writer = FleetWriter(Path(output))
    writer.begin()
    run = FleetRun(writer.folder, tuple(entries), config, on_progress, retry_failed)
    run.replay_all(executor)
    run.show("writing")
    members = [Member(e.id, e.name, e.shown, e.group, dict(e.tags)) for e in entries]
    asked = {drive: done.asked for drive, done in run.done.items()}
    text = run_toml(config, f"{len(entries)} drives", VERSION, "fleet")
    facts = writer.finish(members, config.evaluation, config.as_dict(), text, asked=asked)
    counts = Counter(each.status for each in run.done.values())
    if (allowed := config.fleet.max_failures) is not None:
        most = float(allowed.removesuffix("%"))
        if counts[FAILED] > (most * len(entries) / 100 if allowed.endswith("%") else most):
            raise FleetError(
                f"{run.folder}: {counts[FAILED]} of {len(entries)} drives failed, more than "
                f"`fleet.max_failures` {allowed} allows; their reasons are in drives.parquet"
            )
    problems = {d.drive: d.reason for d in run.done.values() if d.status == FAILED}
    replayed = sum(not each.repeated for each in run.done.values())
    return FleetOutcome(writer.folder, counts, replayed, problems, facts)


@dataclass(slots=True)
class FleetRun:
    """A fleet that is being replayed."""

    folder: Path
    entries: tuple[DriveEntry, ...]
    config: RunConfig
    on_progress: OnFleetProgress
    retry: bool
    done: dict[str, Done] = field(default_factory=dict)
    """What is known of each drive that is done, by its ID."""
    pruned: set[str] = field(default_factory=set)
    workers: int = 1
    began: float = field(default_factory=time.monotonic)

    def replay_all(self, executor: Executor | None) -> None:
        """Replay every drive that is not done."""
        self.show("looking")
        configs = {entry.id: self._of(entry) for entry in self.entries}
        if self.config.fleet.folds is None:
            digest, model = "", self.config.training.model
            if model:
                try:
                    digest = sha256_of(Path(model))
                except OSError as error:
                    raise FleetError(f"{model}: cannot read the model: {error.strerror}") from error
            tasks = [self._task(e, configs[e.id], digest, None) for e in self.entries]
            waiting = self._waiting(tasks) or self._unrecorded(tasks)
            if waiting:
                with self._engine(executor) as engine:
                    self._replay(engine, waiting)
                    self._replay(engine, self._unrecorded(tasks))
        else:
            with self._engine(executor) as engine:
                tasks = self._by_fold(engine, configs)
                self._replay(engine, self._waiting(tasks))
                self._replay(engine, self._unrecorded(tasks))
        self._prune()

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
            )
        )

    def _of(self, entry: DriveEntry) -> RunConfig:
        """Return the configuration of a drive."""
        return replace(entry.config(self.config), fleet=FleetSettings())

    def _task(self, entry: DriveEntry, own: RunConfig, model: str, fold: int | None) -> DriveTask:
        keep = self.config.fleet.keep
        return DriveTask(
            self.folder,
            entry,
            own,
            software(own),
            model,
            fold,
            recorded=keep != "none",
            required=keep == "all",
            retry=self.retry,
        )

    def _waiting(self, tasks: Sequence[DriveTask]) -> list[DriveTask]:
        """Return the tasks of drives that are not done, or whose worker ended before its end.

        A URL is looked at by its worker.
        """
        waiting = []
        for task in tasks:
            ours = task.entry.path is not None and not attempts(task).exists()
            record = valid_record(task) if ours else None
            if record is None:
                waiting.append(task)
            else:
                self.done[record.drive] = done(record, repeated=True)
        return waiting

    def _worst(self) -> list[str] | None:
        """Return the drives so far whose recordings are kept for their ERR; None if all or none."""
        keep = self.config.fleet.keep
        if not keep.startswith("worst:"):
            return None
        scored = [each for each in self.done.values() if each.err is not None]
        worst = sorted(scored, key=lambda each: (-(each.err or 0), each.drive))
        return [each.drive for each in worst[: int(keep.removeprefix("worst:"))]]

    def _unrecorded(self, tasks: Sequence[DriveTask]) -> list[DriveTask]:
        """Return the tasks of the worst drives whose recordings an earlier command has not kept."""
        worst = self._worst()
        if not worst or self.config.output.record == "none":
            return []
        return [
            replace(task, required=True)
            for task in tasks
            if task.entry.id in worst and not recording_path(self.folder, task.entry.id).exists()
        ]

    def _prune(self) -> None:
        """Remove recordings that are not kept, as drives are done: they take the most room."""
        worst = self._worst()
        if worst is None:
            return
        # Once dropped a drive stays so, for more are done and none fewer.
        for drive in self.done.keys() - set(worst) - self.pruned:
            self.pruned.add(drive)
            with suppress(OSError):
                recording_path(self.folder, drive).unlink(missing_ok=True)

    @contextmanager
    def _engine(self, executor: Executor | None) -> Iterator[Executor]:
        if executor is not None:
            yield executor
            return
        asked = self.config.fleet
        with started(asked.workers, asked.memory_gib, asked.scheduler) as (workers, count):
            self.workers = max(count, 1)
            yield workers

    def _by_fold(self, engine: Executor, configs: Mapping[str, RunConfig]) -> list[DriveTask]:
        """Train the folds' models, and return the tasks of the drives with them."""
        settings, count = self.config, self.config.fleet.folds
        assert count is not None
        folds = deal(groups_of(self.entries), count, settings.training.seed)
        by_id = {entry.id: entry for entry in self.entries}
        asked = [by_id[drive] for drive in shuffled(by_id, settings.training.seed)]
        training = [
            FoldTask(
                self.folder,
                fold,
                tuple((e, configs[e.id]) for e in asked if folds[e.id] != fold),
                settings,
                software(settings),
            )
            for fold in range(count)
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
                task = waiting.pop(future)
                try:
                    found = future.result()
                except Exception as error:
                    self._fail(task, self._reason(error, "it was replayed"))
                else:
                    self.done[found.drive] = found
                self._prune()
                self.show("replaying")
        finally:
            for future in waiting:
                future.cancel()

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
        with ending_the_run(self.folder):
            record.write(self.folder)
        self.done[record.drive] = done(record)
