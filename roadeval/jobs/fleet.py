"""Many drives in one run: each replayed in a worker, its record kept, all records made tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadeval.config import RunConfig, run_toml
from roadeval.evaluation.conditions import Condition
from roadeval.fleet.errors import FleetError
from roadeval.fleet.sources import find_drives
from roadeval.jobs.fleet_run import FleetProgress, FleetRun, OnFleetProgress
from roadeval.results.fleet.conditions import check_conditions
from roadeval.results.fleet.folder import FleetWriter
from roadeval.results.fleet.record import DAMAGED, FAILED
from roadeval.results.fleet.tables import Member
from roadeval.runtime.paths import AnyPath, Paths, listed
from roadeval.version import VERSION


def _ignore(_progress: FleetProgress) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True)
class FleetOutcome:
    """The result of replaying a fleet.

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
    unused
        Settings of single drives (`RunConfig.drives`) that hold for none of these, by their paths.
    """

    folder: Path
    counts: Mapping[str, int]
    replayed: int
    problems: Mapping[str, str]
    summary: Mapping[str, Any]
    unused: Sequence[str] = ()

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold, a drive each."""
        return [text for each in self.summary["conditions"] for text in each["holds"].values()]

    @property
    def unjudged(self) -> list[str]:
        """The conditions that could be judged on no drive, with the reason on the first."""
        return [
            f"{each['condition']}: {next(iter(each['not_judged'].values()))}"
            for each in self.summary["conditions"]
            if each["not_judged"] and not each["judged"]
        ]

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
    config = (config or RunConfig()).resolved()
    entries = find_drives([str(drive) for drive in listed(drives)])
    if config.fleet.folds is not None and config.training.model is not None:
        raise FleetError(
            "`fleet.folds` and `training.model` do not go together: folds train models"
        )
    conditions = [Condition.parse(text) for text in fail_if]
    check_conditions(conditions)
    writer = FleetWriter(Path(output))
    writer.begin()
    run = FleetRun(writer.folder, tuple(entries), config, on_progress, retry_failed)
    run.replay_all(executor)
    run.show("writing")
    members = [
        Member(e.id, e.name, e.shown, e.group, e.tags, run.done[e.id].asked) for e in entries
    ]
    text = run_toml(config, f"{len(entries)} drives", VERSION, "fleet")
    summary = writer.finish(members, config.evaluation, config.as_dict(), text, conditions)
    _judge_failures(run, config.fleet.max_failures)
    counts = Counter(each.status for each in run.done.values())
    problems = {d.drive: d.reason for d in run.done.values() if d.status == FAILED}
    replayed = sum(not each.repeated for each in run.done.values())
    unused = config.unused(entry.source for entry in entries)
    return FleetOutcome(writer.folder, counts, replayed, problems, summary, unused)


def _judge_failures(run: FleetRun, allowed: str | None) -> None:
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
