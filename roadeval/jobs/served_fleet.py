"""A fleet on a server: its page, its drives' pages, and its worst frames in the viewer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.fleet_inspect import FleetFrame, recording_of, worst_frames
from roadeval.jobs.progress import OnProgress
from roadeval.jobs.replayed import CancelledReplayError, Replayer
from roadeval.jobs.report import PICTURED
from roadeval.jobs.report_fleet import collect_fleet
from roadeval.jobs.result import DriveResult
from roadeval.jobs.served import ServedDrive, image, policy, viewed
from roadeval.recording.screen.viewer import WindowViewer
from roadeval.report.blocks import Document
from roadeval.report.findings import Commands
from roadeval.report.fleet.document import page_document
from roadeval.report.page.render import Place, page
from roadeval.results.fleet.folder import Fleet
from roadeval.runtime.files import own_names
from roadeval.runtime.local_server import NOT_FOUND, PAGE, Request, Response, told

_PLACE: Final = Place("pictures/", "../", "frame/{}", "../")
_SITE: Final = "../../../"
"""The site's address as the page of a fleet's drive names it."""


class ServedFleet:
    """A fleet's folder.

    Parameters
    ----------
    path
        Of the folder.
    inspect
        Returns the command that opens one of its worst frames, by its rank.
    commands
        Makes the commands that its drives' pages name.
    replayer
        Replays drives of which no recording was kept.
    trust_sources
        See `Fleet`.

    Raises
    ------
    RoadevalError
        If it cannot be read.
    """

    def __init__(
        self,
        path: Path,
        inspect: Callable[[int], str] | None,
        commands: Callable[[DriveResult], Commands] | None,
        replayer: Replayer,
        *,
        trust_sources: bool = False,
    ) -> None:
        self.path: Path = path
        self._fleet: Final = Fleet(path, trust_sources=trust_sources)
        self._inspect: Final = inspect
        self._commands: Final = commands
        self._replayer: Final = replayer
        self._lock: Final = Lock()
        self._drives: Final[dict[Path, ServedDrive]] = {}

    @property
    def title(self) -> str:
        """The fleet's name."""
        return self._fleet.name

    def answer(self, request: Request, viewer: WindowViewer) -> Response:
        """Return what is asked for below its address."""
        match request.parts:
            case () if not request.acts:
                return Response(self._page, PAGE, headers=policy(_PLACE))
            case ("pictures", name) if not request.acts:
                return image(name, self._pictures.get(name))
            case ("worst", rank, "view" | "cancel" as what) if request.acts and rank.isdecimal():
                frame = self._worst.get(int(rank))
                if frame is None:
                    return NOT_FOUND
                return self._view(frame, viewer) if what == "view" else self._cancel(frame)
            case ("drive", place, *rest) if place.isdecimal() and int(place) < len(self._names):
                return self._drive(self._names[int(place)], tuple(rest), request, viewer)
        return NOT_FOUND

    @cached_property
    def _names(self) -> list[str]:
        names: list[str] = self._fleet.table("drives", ["drive"])["drive"].to_pylist()
        return names

    @cached_property
    def _worst(self) -> Mapping[int, FleetFrame]:
        if not self._fleet.table("worst").num_rows:
            return {}
        return {each.rank: each for each in worst_frames(self._fleet, PICTURED)}

    @cached_property
    def _document(self) -> Document:
        inspect = self._inspect or (lambda _rank: "")
        with self._lock:
            return page_document(collect_fleet(self._fleet, inspect, PICTURED))

    @cached_property
    def _page(self) -> bytes:
        return page(self._document, _PLACE)

    @cached_property
    def _pictures(self) -> Mapping[str, bytes]:
        return self._document.files()

    def _drive(
        self, drive: str, rest: tuple[str, ...], request: Request, viewer: WindowViewer
    ) -> Response:
        """Answer below the address of a drive's own page."""
        if not rest and not request.folder:
            return NOT_FOUND
        below = Request(rest, request.acts, request.folder)
        return self._served(drive).answer(below, viewer)

    def _served(self, drive: str) -> ServedDrive:
        """Return a drive as it lies in the folder now: its recording, or else its tables."""
        recording = self._fleet.recording(drive)
        path = recording if recording.exists() else self._fleet.results(drive)
        with self._lock:
            if path not in self._drives:
                above = ("../../", self.title)
                self._drives[path] = ServedDrive(path, self._commands, _SITE, above)
            return self._drives[path]

    def _view(self, frame: FleetFrame, viewer: WindowViewer) -> Response:
        """Show one of the worst frames; its drive is replayed where no recording was kept."""
        drive = frame.drive
        try:
            recording = self._fleet.recording(drive)
            state = self._replayer.want(recording, drive, partial(self._replay, drive))
            if state:
                return told(HTTPStatus.ACCEPTED, state)
        except RoadevalError as error:
            return told(HTTPStatus.CONFLICT, str(error))
        return viewed(viewer, recording, frame.frame)

    def _replay(self, drive: str, on_progress: OnProgress) -> None:
        """Make a drive's recording; nothing is left of one that is cancelled."""
        try:
            recording_of(self._fleet, drive, on_progress)
        except CancelledReplayError:
            for left in own_names(self._fleet.recording(drive), hidden=False):
                left.unlink(missing_ok=True)
            raise

    def _cancel(self, frame: FleetFrame) -> Response:
        self._replayer.cancel(self._fleet.recording(frame.drive))
        return Response(b"")
