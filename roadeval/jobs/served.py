"""What a server gives of one result: its page, its pictures, and a frame opened in the viewer."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import cached_property
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Final, Protocol

from roadeval.errors import RoadevalError
from roadeval.jobs.fleet_inspect import worst_frames
from roadeval.jobs.page_frames import StripMaker, browsed
from roadeval.jobs.report import PICTURED
from roadeval.jobs.report_findings import collect
from roadeval.jobs.report_fleet import collect_fleet
from roadeval.jobs.result import Result
from roadeval.recording.screen.steered import SteeredViewer
from roadeval.report.blocks import Document, Heading
from roadeval.report.browse import Strip
from roadeval.report.drive import page_document
from roadeval.report.findings import Commands
from roadeval.report.fleet.document import page_document as fleet_page_document
from roadeval.report.page.render import Place, page, part
from roadeval.report.sections.browse import LARGE
from roadeval.results.fleet.folder import Fleet
from roadeval.runtime.local_server import NOT_FOUND, PAGE, Request, Response, told

STRIPS: Final = 40
"""Frames whose pictures are kept in memory."""
_MEDIA: Final = {"jpg": "image/jpeg", "png": "image/png", "svg": "image/svg+xml"}
_AT_HOME: Final = Place("pictures/", "../", "frame/{}", "../")
_AT_FRAME: Final = Place("../pictures/", "../../", "../frame/{}", "../")
"""Places of a result's page, and of one frame's."""


class Served(Protocol):
    """A result that is served; ``path`` is where it lies."""

    path: Path

    @property
    def title(self) -> str:
        """Its name."""

    @property
    def recordings(self) -> Mapping[Path, str]:
        """The recordings that the viewer may show, with their names."""

    def answer(self, request: Request, viewer: SteeredViewer) -> Response:
        """Return what is asked for below its address."""


class ServedDrive:
    """A drive's result.

    Parameters
    ----------
    path
        A recording or results folder.
    commands
        Makes the commands that its page names.

    Raises
    ------
    RoadevalError
        If it cannot be read.
    """

    def __init__(self, path: Path, commands: Callable[[Result], Commands] | None) -> None:
        self.path: Path = path
        self._result: Final = Result(path)
        self._commands: Final = commands(self._result) if commands else None
        self._lock: Final = Lock()
        self._strips: Final[OrderedDict[int, Strip]] = OrderedDict()
        self._frames: Final = frozenset(self._result.pictured)

    @property
    def title(self) -> str:
        """The drive's name."""
        return self._result.name

    @property
    def recordings(self) -> Mapping[Path, str]:
        """Its recording; none of a folder."""
        return {self._result.path: self.title} if self._result.recording else {}

    def answer(self, request: Request, viewer: SteeredViewer) -> Response:
        """Return what is asked for below its address."""
        match request.parts:
            case () if not request.acts:
                return Response(self._page, PAGE, headers=_policy(_AT_HOME))
            case ("pictures", name) if not request.acts:
                return self._picture(name)
            case ("frame", number, *rest) if number.isdecimal() and int(number) in self._frames:
                return self._frame(int(number), tuple(rest), viewer, acts=request.acts)
        return NOT_FOUND

    @cached_property
    def _document(self) -> Document:
        inspect = self._commands.inspect if self._commands else None
        with self._lock:
            return page_document(
                collect(self._result, self._commands), browsed(self._result, inspect)
            )

    @cached_property
    def _page(self) -> bytes:
        return page(self._document, _AT_HOME)

    @cached_property
    def _pictures(self) -> Mapping[str, bytes]:
        return self._document.files()

    @cached_property
    def _maker(self) -> StripMaker:
        inspect = self._commands.inspect if self._commands else None
        return StripMaker(self._result, inspect, LARGE)

    def _picture(self, name: str) -> Response:
        with self._lock:
            strips = [*self._strips.values()]
        found = next((i for each in strips for i in each.images() if i.name == name), None)
        return _image(name, found.content if found else self._pictures.get(name))

    def _strip(self, frame: int) -> Strip:
        with self._lock:
            if frame not in self._strips:
                self._strips[frame] = self._maker.strip(frame)
                while len(self._strips) > STRIPS:
                    self._strips.popitem(last=False)
            self._strips.move_to_end(frame)
            return self._strips[frame]

    def _frame(
        self, frame: int, rest: tuple[str, ...], viewer: SteeredViewer, *, acts: bool
    ) -> Response:
        match rest, acts:
            case ("part",), False:
                return Response(part(self._strip(frame), _AT_HOME), PAGE)
            case (), False:
                made = Document(
                    "frame",
                    self.title,
                    f"frame {frame}",
                    "",
                    [Heading(f"Frame {frame}"), self._strip(frame)],
                )
                return Response(page(made, _AT_FRAME), PAGE, headers=_policy(_AT_FRAME))
            case ("view",), True:
                return _viewed(viewer, self._result.path, frame)
        return NOT_FOUND


class ServedFleet:
    """A fleet's folder.

    Parameters
    ----------
    path
        Of the folder.
    inspect
        Returns the command that opens one of its worst frames, by its rank.

    Raises
    ------
    RoadevalError
        If it cannot be read.
    """

    def __init__(self, path: Path, inspect: Callable[[int], str] | None) -> None:
        self.path: Path = path
        self._fleet: Final = Fleet(path)
        self._inspect: Final = inspect
        self._lock: Final = Lock()

    @property
    def title(self) -> str:
        """The fleet's name."""
        return self._fleet.name

    @cached_property
    def recordings(self) -> Mapping[Path, str]:
        """The recordings that were kept of the drives with the worst frames."""
        return {place: drive for drive, place, _ in self._kept.values() if place}

    def answer(self, request: Request, viewer: SteeredViewer) -> Response:
        """Return what is asked for below its address."""
        match request.parts:
            case () if not request.acts:
                return Response(self._page, PAGE, headers=_policy(_AT_HOME))
            case ("pictures", name) if not request.acts:
                return _image(name, self._pictures.get(name))
            case ("worst", rank, "view") if request.acts and rank.isdecimal():
                return self._view(int(rank), viewer)
        return NOT_FOUND

    @cached_property
    def _kept(self) -> Mapping[int, tuple[str, Path | None, int]]:
        """The worst frames by rank: drive, recording where it was kept, and number."""
        if not self._fleet.table("worst").num_rows:
            return {}
        found = enumerate(worst_frames(self._fleet, PICTURED), 1)
        return {rank: (each.drive, each.recording, each.frame) for rank, each in found}

    @cached_property
    def _document(self) -> Document:
        with self._lock:
            return fleet_page_document(collect_fleet(self._fleet, self._inspect, PICTURED))

    @cached_property
    def _page(self) -> bytes:
        return page(self._document, _AT_HOME)

    @cached_property
    def _pictures(self) -> Mapping[str, bytes]:
        return self._document.files()

    def _view(self, rank: int, viewer: SteeredViewer) -> Response:
        drive, recording, frame = self._kept.get(rank, ("", None, 0))
        if recording is None:
            sentence = f"No recording of {drive or 'this drive'} was kept: type the command."
            return told(HTTPStatus.CONFLICT, sentence)
        return _viewed(viewer, recording, frame)


def _viewed(viewer: SteeredViewer, recording: Path, frame: int) -> Response:
    """Show a frame in the viewer; answer where it is to be seen, if that is in the browser."""
    try:
        added = viewer.show(recording, frame)
    except RoadevalError as error:
        return told(HTTPStatus.CONFLICT, str(error))
    return Response(f"../viewer/{added}".encode() if added else b"")


def _image(name: str, content: bytes | None) -> Response:
    if content is None:
        return NOT_FOUND
    return Response(content, _MEDIA[name.rpartition(".")[2]], kept=True)


def _policy(place: Place) -> dict[str, str]:
    return {"Content-Security-Policy": f"{place.policy}; frame-ancestors 'none'"}
