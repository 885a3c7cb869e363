"""A fleet's drive of which no recording was kept, replayed to be looked at."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Lock
from typing import Final

from roadeval.config import OutputSettings, RunConfig, load_config
from roadeval.errors import RoadevalError
from roadeval.fleet.entry import is_url, shown
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run.fleet_work import model_path
from roadeval.jobs.run.replay import replay
from roadeval.results.fleet import FleetFolder
from roadeval.results.folder import RUN
from roadeval.results.schema import FAILED

FEWEST: Final = "worst:10"
"""The pictures that are recorded, where the fleet's settings ask for none."""
Replay = Callable[[Callable[[Progress], None]], object]
"""Replays a drive, reports its progress, and ends where that raises."""


def recording_of(
    fleet: FleetFolder,
    drive: str,
    on_progress: OnProgress = ignore,
    on_replay: Callable[[str], None] = lambda _sentence: None,
) -> tuple[Path, tuple[str, ...]]:
    """Return the recording of a fleet's drive, made again from its log where it was not kept.

    Returned are the file, and warnings. ``on_replay`` is called with a sentence where the drive is
    replayed. A `RoadevalError` if there is no such drive, its log has gone or may not be read, or
    it cannot be replayed.
    """
    row = fleet.drives.get(drive)
    if row is None:
        alike = [other for other, own in fleet.drives.items() if own["name"] == drive]
        hint = f"; by that name there is {', '.join(alike)}" if alike else ""
        raise RoadevalError(f"{fleet.path}: no drive {drive}{hint}; `drives.parquet` names all")
    if (recording := fleet.recording(drive)).exists():
        return recording, ()
    recording = fleet.recording(drive, new=True)
    named, source = str(row["source"]), shown(str(row["source"]))
    if row["status"] == FAILED:
        raise RoadevalError(f"{source}: has no recording, for it failed: {row['reason']}")
    if not fleet.trust_sources:
        raise RoadevalError(
            f"{drive}: no recording was kept; `trust_sources` replays it from {source}, with the "
            f"masks, networks and model of {fleet.results(drive) / RUN}"
        )
    if not is_url(named) and not Path(named).exists():
        raise RoadevalError(
            f"{source}: has gone, and no recording of it was kept; bring the log back, or see "
            f"{fleet.path / 'pictures' / drive}"
        )
    config = _configuration(fleet, drive, row["fold"])
    on_replay(f"{drive}: no recording was kept, so it is replayed from {source}")
    if _replayed(named, config, recording, on_progress) == row["log_digest"]:
        return recording, ()
    warning = f"{source}: has changed since the fleet was run, and its results may have, too"
    return recording, (warning,)


def _configuration(fleet: FleetFolder, drive: str, fold: int | None) -> RunConfig:
    """Return what a drive was replayed with; the model of its fold as it lies in the folder now."""
    path = fleet.results(drive) / RUN
    if not path.exists():
        raise RoadevalError(f"{path}: is not there; run the fleet's command again")
    config = load_config(path, trusted=False)
    if fold is None:
        return config
    return config.override({"training": {"model": str(model_path(fleet.path, fold))}})


def _replayed(
    source: str, config: RunConfig, recording: Path, on_progress: OnProgress
) -> str | None:
    """Replay a drive for its recording alone; return the digest of its log.

    The fleet's results stay as they are.
    """
    record = FEWEST if config.output.record == "none" else config.output.record
    with tempfile.TemporaryDirectory(prefix="roadeval-") as reports:
        output = OutputSettings(
            save=str(recording), reports=str(Path(reports, "reports")), record=record, figures=False
        )
        made = replay(source, replace(config, output=output), on_progress=on_progress)
        return made.facts.log_digest


class CancelledReplayError(RoadevalError):
    """The server ends before the replay does."""


@dataclass(slots=True)
class _Replay:
    """A replay in its thread, and how far it is."""

    name: str
    stop: Event
    progress: str = "it begins"
    future: Future[object] | None = None

    @property
    def state(self) -> str:
        """How far it is, in a sentence."""
        return f"Replaying {self.name}: {self.progress} \N{HORIZONTAL ELLIPSIS}"

    def report(self, progress: Progress) -> None:
        """Note how far it is; a `CancelledReplayError` if it is to end."""
        if self.stop.is_set():
            raise CancelledReplayError(f"the replay of {self.name} was cancelled")
        of = "" if progress.total is None else f" of {progress.total}"
        self.progress = f"{progress.stage} {progress.done}{of}"


class Replayer:
    """Replays drives in a thread beside the server, one after the other."""

    def __init__(self) -> None:
        self._lock: Final = Lock()
        self._stop: Final = Event()
        self._thread: Final = ThreadPoolExecutor(1, "replay")
        self._replays: Final[dict[Path, _Replay]] = {}

    def want(self, recording: Path, name: str, replay: Replay) -> str:
        """Have a drive's recording made, or return how far that is; empty once it is there.

        A `RoadevalError` if it failed; who asks again begins again.
        """
        with self._lock:
            own = self._replays.get(recording)
            if own is None and recording.exists():
                return ""
            if own is None or own.future is None:
                own = self._replays[recording] = _Replay(name, self._stop)
                own.future = self._thread.submit(replay, own.report)
            if not own.future.done():
                return own.state
            del self._replays[recording]
            error = own.future.exception()
            if error and not isinstance(error, RoadevalError):
                raise RoadevalError(f"{name}: the replay failed: {error!r}") from error
            if error:
                raise error
            return ""

    def close(self) -> None:
        """End what is replayed, after its next frame."""
        self._stop.set()
        self._thread.shutdown(cancel_futures=True)
