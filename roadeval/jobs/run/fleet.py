"""Many drives in one run: workers replay them, and then the tables of all drives are written."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from roadeval.config.run import RunConfig, run_toml
from roadeval.errors import RoadevalError
from roadeval.fleet.drives import (
    DriveEntry,
    FleetError,
    deal,
    find_drives,
    groups_of,
    name_cameras,
    shuffle,
)
from roadeval.fleet.engine import ATTEMPTS, is_worker_death, start_workers
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run import fleet_work
from roadeval.jobs.run.fleet_work import Done, DriveTask
from roadeval.jobs.run.prepared import software
from roadeval.results.facts import FleetFacts, Member, Origin
from roadeval.results.fleet import FleetWriter, made_path
from roadeval.results.schema import DAMAGED, FAILED
from roadeval.runtime.files import AnyPath, Paths, is_claimed, reading, sha256_of
from roadeval.runtime.repository import current_commit
from roadeval.runtime.sentence import Sentence
from roadeval.version import VERSION


@dataclass(frozen=True)
class FleetOutcome:
    """The result of replaying a fleet."""

    folder: Path
    counts: Mapping[str, int]
    replayed: int
    """Number of drives that this command has replayed."""
    problems: Mapping[str, str]
    """The reasons why drives failed, by the drives' names in the fleet."""
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
    on_progress: OnProgress = ignore,
) -> FleetOutcome:
    """Replay many drives, and write the tables of all of them.

    A drive is not replayed again if the folder has its results, made from the same log, settings,
    model and version; a failed drive is tried again. A `RoadevalError` if there is no drive, or the
    folder or the engine cannot be used.

    Parameters
    ----------
    drives
        Logs, rosbag2 folders, folders that are searched, patterns, URLs, and manifests: see
        `roadeval.fleet.drives.find_drives`.
    output
        The fleet's folder, which the workers must see under the same path.
    config
        Every option, with the options of the fleet (`RunConfig.fleet`).
    executor
        Runs the replays; by default Dask's workers, as `RunConfig.fleet` says.
    on_progress
        Called in the caller's thread whenever a drive is done.
    """
    commit, config = current_commit(), (config or RunConfig()).resolved()
    entries = find_drives(drives)
    if config.cameras:
        entries = name_cameras(
            [camera for entry in entries for camera in entry.of_cameras(config.cameras)]
        )
    if config.fleet.folds is not None and config.training.model is not None:
        problem = Sentence("does not go with {training.model}: folds train models")
        raise FleetError(problem, setting="fleet.folds")
    if config.output.focus:
        names = (name for entry in entries for name in entry.config(config).names())
        config.check_focus(dict.fromkeys(names))
    writer = FleetWriter(Path(output))
    writer.begin()
    run = FleetRun(
        writer.folder, tuple(entries), replace(config, cameras=()), on_progress, executor
    )
    run.replay_all()
    run.show("writing")
    members = [Member(e.id, e.name, e.shown, e.group, dict(e.tags)) for e in entries]
    asked_digests = {drive: done.asked for drive, done in run.done.items()}
    text = run_toml(config, f"{len(entries)} drives", VERSION, "fleet")
    settings = config.evaluation, config.as_dict(), text
    origin = Origin(time.time_ns(), *commit, {**config.output.labels})
    facts = writer.finish(members, *settings, asked=asked_digests, origin=origin)
    counts = Counter(drive.status for drive in run.done.values())
    problems = {d.drive: d.reason for d in run.done.values() if d.status == FAILED}
    replayed = sum(not drive.repeated for drive in run.done.values())
    return FleetOutcome(writer.folder, counts, replayed, problems, facts)


@dataclass(slots=True)
class FleetRun:
    """A fleet that is being replayed."""

    folder: Path
    entries: tuple[DriveEntry, ...]
    config: RunConfig
    on_progress: OnProgress
    executor: Executor | None
    """It runs the tasks. It is None until the first task, for which Dask's workers are started."""
    workers: int = 1
    done: dict[str, Done] = field(default_factory=dict)
    """Reports of the drives that are done, by their IDs."""
    stack: ExitStack = field(default_factory=ExitStack)
    """It ends the processes that were started for the run."""

    def replay_all(self) -> None:
        """Replay every drive that is not done."""
        self.show("looking")
        with self.stack:
            folds = self.config.fleet.folds
            tasks = [*self._by_model()] if folds is None else self._by_fold(folds)
            self._replay(self._waiting(tasks))

    def show(self, stage: str) -> None:
        """Report the progress to the caller."""
        done, detail = self.done.values(), []
        if failed := sum(drive.status == FAILED for drive in done):
            detail.append(f"{failed} failed")
        if stage == "replaying" and (left := len(self.entries) - len(done)):
            detail.append(f"{min(left, self.workers)} running")
        progress = Progress(len(done), len(self.entries), stage, "", "drives", ", ".join(detail))
        self.on_progress(progress)

    def _by_model(self) -> Iterator[DriveTask]:
        """Yield the tasks of drives that one model scores, or that train their own."""
        digest, model = "", self.config.training.model
        if model:
            with reading(model, FleetError, "cannot read the model"):
                digest = sha256_of(Path(model))
        for entry in self.entries:
            config = entry.config(self.config)
            yield DriveTask(self.folder, entry, config, software(config), digest)

    def _waiting(self, tasks: Sequence[DriveTask]) -> list[DriveTask]:
        """Return the tasks of drives that are not done. Workers check drives behind URLs."""
        waiting = []
        for task in tasks:
            # If another run claims the drive, a worker waits for it, or removes what a killed run
            # left.
            claimed = is_claimed(made_path(self.folder, task.entry.id))
            made = None if task.entry.path is None or claimed else fleet_work.find_valid(task)
            if made is None:
                waiting.append(task)
            else:
                self.done[made.drive] = fleet_work.report_drive(self.folder, made, repeated=True)
        return waiting

    def _engine(self) -> Executor:
        """Return the executor that does the tasks."""
        if self.executor is None:
            starting = start_workers(self.config.run.jobs, self.config.fleet.scheduler)
            self.executor, count = self.stack.enter_context(starting)
            self.workers = max(count, 1)
        return self.executor

    def _by_fold(self, count: int) -> list[DriveTask]:
        """Train the folds' models, and return the tasks of the drives with them."""
        settings, engine = self.config, self._engine()
        configs = {entry.id: entry.config(settings) for entry in self.entries}
        folds = deal(groups_of(self.entries), count, settings.training.seed)
        by_id = {entry.id: entry for entry in self.entries}
        drawn = [by_id[drive] for drive in shuffle(by_id, settings.training.seed)]
        training = []
        for fold in range(count):
            others = tuple((e, configs[e.id]) for e in drawn if folds[e.id] != fold)
            about = fold, others, settings, software(settings)
            training.append(fleet_work.FoldTask(self.folder, *about))
        self.show("training")
        futures = [engine.submit(fleet_work.train_fold, task) for task in training]
        models, tasks = [], []
        for fold, future in enumerate(futures):
            try:
                models.append(future.result())
            except Exception as error:  # only the fold's drives fail
                models.append(("", self._reason(error, f"the model of fold {fold} was trained")))
        for entry in self.entries:
            fold = folds[entry.id]
            digest, problem = models[fold]
            path = str(training[fold].path)
            config = configs[entry.id].override({"training": {"model": path}})
            task = DriveTask(self.folder, entry, config, software(config), digest, fold)
            if problem:
                self._fail(task, problem)
            else:
                tasks.append(task)
        return tasks

    def _replay(self, tasks: Sequence[DriveTask]) -> None:
        """Replay the tasks' drives, and take each result as it comes."""
        if not tasks:
            return
        engine = self._engine()
        self.show("replaying")
        waiting = {engine.submit(fleet_work.replay_drive, task): task for task in tasks}
        try:
            for future in as_completed(list(waiting)):
                task = waiting.pop(future)
                try:
                    report = future.result()
                except Exception as error:
                    self._fail(task, self._reason(error, "it was replayed"))
                else:
                    self.done[report.drive] = report
                self.show("replaying")
        finally:
            for future in waiting:
                future.cancel()

    def _reason(self, error: Exception, doing: str) -> str:
        """Return why a task has failed; raise an error that ends the whole run."""
        if isinstance(error, RoadevalError):
            raise error
        if isinstance(error, CancelledError):
            problem = "the workers have gone, or their scheduler"
            raise FleetError(problem, where=self.folder, remedy=fleet_work.GO_ON) from error
        if is_worker_death(error):
            return (
                f"its worker process ended {ATTEMPTS} times while {doing}, as it does when memory "
                "runs out"
            )
        return " ".join(f"{type(error).__name__}: {error}".split())

    def _fail(self, task: DriveTask, reason: str) -> None:
        made = fleet_work.mark_failed(task, reason)
        with fleet_work.ending_the_run(self.folder):
            made.write(self.folder)
        self.done[made.drive] = fleet_work.report_drive(self.folder, made)
