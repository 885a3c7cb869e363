"""Many drives in one run: each replayed in a worker, its record kept, all records made tables."""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from roadeval.config import RunConfig
from roadeval.config.toml import run_toml
from roadeval.errors import RoadevalError
from roadeval.evaluation.conditions import Condition
from roadeval.fleet.engine import ATTEMPTS, died, started
from roadeval.fleet.entry import DriveEntry
from roadeval.fleet.errors import FleetError
from roadeval.fleet.folds import deal, shuffled
from roadeval.fleet.sources import find_drives
from roadeval.jobs.fleet_drive import Done, DriveTask, done, failed, replay_drive, standing
from roadeval.jobs.fleet_models import FoldTask, train_fold
from roadeval.jobs.outputs import AnyPath
from roadeval.results.fleet.conditions import check_conditions
from roadeval.results.fleet.folder import FleetWriter
from roadeval.results.fleet.record import DAMAGED, FAILED, recording_path
from roadeval.results.fleet.tables import Member
from roadeval.version import VERSION


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


def _ignore(_progress: FleetProgress) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True)
class FleetOutcome:
    """What a fleet's run left.

    Parameters
    ----------
    folder
        Where it lies.
    counts
        Drives by their status.
    replayed
        How many of them this command has replayed.
    problems
        Why drives failed, by the drives' names in the fleet.
    summary
        The content of ``fleet.json``.
    """

    folder: Path
    counts: Mapping[str, int]
    replayed: int
    problems: Mapping[str, str]
    summary: Mapping[str, Any]

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold, a drive each."""
        return [text for each in self.summary["conditions"] for text in each["holds"].values()]

    @property
    def lost(self) -> bool:
        """Whether a drive failed, or a part of one was lost."""
        return bool(self.counts.get(FAILED) or self.counts.get(DAMAGED))


def replay_fleet(
    drives: Sequence[AnyPath],
    output: AnyPath,
    config: RunConfig | None = None,
    *,
    executor: Executor | None = None,
    fail_if: Sequence[str] = (),
    retry_failed: bool = False,
    on_progress: OnFleetProgress = _ignore,
) -> FleetOutcome:
    """Replay many drives, and write the tables of all of them.

    The folder is the state: a drive whose record stands there, made of the same log, settings,
    model and version, is not replayed again.

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
    fail_if
        Conditions on a rate of each drive, as ``post.filtered.ERR > 20%``; see
        `roadeval.evaluation.conditions`.
    retry_failed
        Whether drives that failed before are tried again.
    on_progress
        Called in the caller's thread as drives are done.

    Raises
    ------
    RoadevalError
        If there is no drive, or the folder or the engine cannot be used, or more drives fail than
        ``fleet.max_failures`` allows: then all that was done is kept.
    """
    config = config or RunConfig()
    entries = find_drives([str(drive) for drive in drives])
    if config.fleet.folds is not None and config.training.model is not None:
        raise FleetError(
            "`fleet.folds` and `training.model` do not go together: folds train models"
        )
    conditions = [Condition.parse(text) for text in fail_if]
    check_conditions(conditions)
    writer = FleetWriter(Path(output))
    writer.begin()
    run = _Run(writer.folder, tuple(entries), config, on_progress, retry_failed)
    run.all_of_them(executor)
    run.show("writing")
    members = [Member(e.id, e.name, e.shown, e.group, e.tags) for e in entries]
    text = run_toml(config, f"{len(entries)} drives", VERSION, "fleet")
    summary = writer.finish(members, config.evaluation, config.as_dict(), text, conditions)
    _judge_failures(run, config.fleet.max_failures)
    counts = Counter(each.status for each in run.done.values())
    problems = {d.drive: d.reason for d in run.done.values() if d.status == FAILED}
    replayed = sum(not each.repeated for each in run.done.values())
    return FleetOutcome(writer.folder, counts, replayed, problems, summary)


@dataclass(slots=True)
class _Run:
    """A fleet on its way."""

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

    def all_of_them(self, executor: Executor | None) -> None:
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
        """Tell how far the fleet is."""
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
        groups = {entry.id: entry.group or entry.id for entry in self.entries}
        folds = deal(groups, settings.fleet.folds, settings.training.seed)
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
        made = [future.result() for future in [engine.submit(train_fold, t) for t in training]]
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

    def _replay(self, engine: Executor, tasks: Sequence[DriveTask]) -> None:
        """Have every task done, and keep what is learnt as it comes."""
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
        except RoadevalError:
            raise
        except CancelledError as error:
            raise FleetError(
                f"{self.folder}: the workers have gone, or their scheduler; what is done is kept, "
                "and the same command again does the rest"
            ) from error
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            if died(error):
                reason = (
                    f"its worker process ended {ATTEMPTS} times while it was replayed, as it does "
                    "where memory runs out"
                )
            self._fail(task, reason)
        else:
            self.done[found.drive] = found

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


def _judge_failures(run: _Run, allowed: str | None) -> None:
    """Raise a `FleetError` where more drives failed than may."""
    if allowed is None:
        return
    count = sum(each.status == FAILED for each in run.done.values())
    share = allowed.endswith("%")
    most = float(allowed.removesuffix("%")) * (len(run.entries) / 100 if share else 1)
    if count > most:
        raise FleetError(
            f"{run.folder}: {count} of {len(run.entries)} drives failed, more than "
            f"`fleet.max_failures` {allowed} allows; their reasons are in drives.parquet"
        )


def _sha256(model: str) -> str:
    try:
        return hashlib.sha256(Path(model).read_bytes()).hexdigest()
    except OSError as error:
        raise FleetError(f"{model}: cannot read the model: {error.strerror}") from error
