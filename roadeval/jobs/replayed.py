"""Drives of served fleets that are replayed when somebody wants to see them: one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.progress import Progress

PATIENCE_S: Final = 20.0
"""How long a replay that is cancelled may take to end: it looks after every frame."""
Replay = Callable[[Callable[[Progress], None]], object]
"""Replays a drive; it is given what to tell of its progress, and ends where that raises."""


class CancelledReplayError(RoadevalError):
    """The replay was cancelled."""


@dataclass(slots=True)
class _Running:
    """A replay in its thread: what it has told, and why it failed."""

    recording: Path
    name: str
    stop: Event = field(default_factory=Event)
    told: str = "it begins"
    failure: str = ""
    thread: Thread | None = None

    @property
    def state(self) -> str:
        """Where it stands, in a sentence."""
        return f"Replaying {self.name}: {self.told} \N{HORIZONTAL ELLIPSIS}"

    def tell(self, progress: Progress) -> None:
        """Take down how far it is.

        Raises
        ------
        CancelledReplayError
            If it is to end.
        """
        if self.stop.is_set():
            raise CancelledReplayError(f"the replay of {self.name} was cancelled")
        of = "" if progress.total is None else f" of {progress.total}"
        self.told = f"{progress.stage} {progress.done}{of}"


class Replayer:
    """Replays drives in a thread beside the server, one at a time."""

    def __init__(self) -> None:
        self._lock: Final = Lock()
        self._running: _Running | None = None

    def want(self, recording: Path, name: str, replay: Replay) -> str:
        """Have a recording made, or see how far it is.

        Parameters
        ----------
        recording
            The file that will be there.
        name
            Of the drive.
        replay
            Makes it.

        Returns
        -------
        str
            Where the replay stands; empty once the recording is there.

        Raises
        ------
        RoadevalError
            If it failed or was cancelled, or another drive's replay has not ended; who asks again
            begins again.
        """
        with self._lock:
            running = self._running
            if running and running.thread and running.thread.is_alive():
                if running.recording != recording:
                    raise RoadevalError(
                        f"{running.state} Only one drive is replayed at a time: wait for it, or "
                        "cancel it."
                    )
                return running.state
            self._running = None
            if running and running.recording == recording and running.failure:
                raise RoadevalError(running.failure)
            if recording.exists():
                return ""
            self._running = self._begun(recording, name, replay)
            return self._running.state

    def _begun(self, recording: Path, name: str, replay: Replay) -> _Running:
        running = _Running(recording, name)

        def run() -> None:
            try:
                replay(running.tell)
            except RoadevalError as error:
                running.failure = str(error)
            except Exception as error:
                running.failure = f"{name}: the replay failed: {error!r}"
                raise

        running.thread = Thread(target=run, name=f"replay of {name}", daemon=True)
        running.thread.start()
        return running

    def cancel(self, recording: Path | None = None) -> None:
        """End the replay of a recording, or whichever there is; it has ended afterwards."""
        with self._lock:
            running = self._running
            if running is None or recording not in (None, running.recording):
                return
            running.stop.set()
            if running.thread:
                running.thread.join(PATIENCE_S)
            self._running = None
