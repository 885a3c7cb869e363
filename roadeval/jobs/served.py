"""A drive on a server: its page, its pictures, and its frames in the viewer."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import cached_property
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Final, Protocol

from roadeval.errors import RoadevalError
from roadeval.jobs.page_frames import StripMaker, browsed
from roadeval.jobs.report_findings import collect
from roadeval.jobs.result import DriveResult
from roadeval.recording.screen.viewer import WindowViewer
from roadeval.report.blocks import Document, Heading, Strip
from roadeval.report.drive import page_document
from roadeval.report.findings import Commands
from roadeval.report.page.render import Place, page, part
from roadeval.report.sections.browse import LARGE
from roadeval.runtime.local_server import NOT_FOUND, PAGE, Request, Response, told

STRIPS: Final = 40
"""Frames whose pictures are kept in memory."""
_MEDIA: Final = {"jpg": "image/jpeg", "png": "image/png", "svg": "image/svg+xml"}


class Served(Protocol):
    """A result that is served; ``path`` is where it lies."""

    path: Path

    @property
    def title(self) -> str:
        """Its name."""

    def answer(self, request: Request, viewer: WindowViewer) -> Response:
        """Return what is asked for below its address."""


class ServedDrive:
    """A drive's result.

    Parameters
    ----------
    path
        A recording or results folder.
    commands
        Makes the commands that its page names.
    site
        The address of the whole site, as its page names it.
    above
        The address and the title of the page above.

    Raises
    ------
    RoadevalError
        If it cannot be read.
    """

    def __init__(
        self,
        path: Path,
        commands: Callable[[DriveResult], Commands] | None,
        site: str = "../",
        above: tuple[str, str] = ("../", "All results"),
    ) -> None:
        self.path: Path = path
        self._result: Final = DriveResult(path)
        self._commands: Final = commands(self._result) if commands else None
        self._lock: Final = Lock()
        self._strips: Final[OrderedDict[int, Strip]] = OrderedDict()
        self._frames: Final = frozenset(self._result.pictured)
        self._place: Final = Place("pictures/", site, "frame/{}", *above)
        self._frame_place: Final = Place(
            *("../pictures/", f"../{site}", "../frame/{}", "../", self.title), forms=True
        )

    @property
    def title(self) -> str:
        """The drive's name."""
        return self._result.name

    def answer(self, request: Request, viewer: WindowViewer) -> Response:
        """Return what is asked for below its address."""
        match request.parts:
            case () if not request.acts:
                return Response(self._page, PAGE, headers=policy(self._place))
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
        return page(self._document, self._place)

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
        return image(name, found.content if found else self._pictures.get(name))

    def _strip(self, frame: int) -> Strip:
        with self._lock:
            if frame not in self._strips:
                self._strips[frame] = self._maker.strip(frame)
                while len(self._strips) > STRIPS:
                    self._strips.popitem(last=False)
            self._strips.move_to_end(frame)
            return self._strips[frame]

    def _frame(
        self, frame: int, rest: tuple[str, ...], viewer: WindowViewer, *, acts: bool
    ) -> Response:
        match rest, acts:
            case ("part",), False:
                return Response(part(self._strip(frame), self._place), PAGE)
            case (), False:
                return self._frame_page(frame)
            case ("view",), True:
                return viewed(viewer, self.path, frame)
            case ("show",), True:
                shown = viewed(viewer, self.path, frame)
                return moved("../..") if shown.succeeded else shown
        return NOT_FOUND

    def _frame_page(self, frame: int) -> Response:
        blocks = [Heading(f"Frame {frame}"), self._strip(frame)]
        made = Document("frame", self.title, f"frame {frame}", "", blocks)
        place = self._frame_place
        return Response(page(made, place), PAGE, headers=policy(place))


def viewed(viewer: WindowViewer, recording: Path, frame: int) -> Response:
    """Show a frame in the viewer; the answer is empty, or says why it cannot be shown."""
    try:
        viewer.show(recording, frame)
    except RoadevalError as error:
        return told(HTTPStatus.CONFLICT, str(error))
    return Response(b"")


def image(name: str, content: bytes | None) -> Response:
    """Return a picture that the page names; None is one that it does not."""
    if content is None:
        return NOT_FOUND
    return Response(content, _MEDIA[name.rpartition(".")[2]], kept=True)


def moved(to: str) -> Response:
    """Return where the browser is to look instead."""
    return Response(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": to})


def policy(place: Place) -> dict[str, str]:
    """Return the header that says what a page may ask for."""
    return {"Content-Security-Policy": f"{place.policy}; frame-ancestors 'none'"}
