"""Results served as pages on this machine: every frame's pictures, and the viewer a click away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from functools import cached_property, partial
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.results.frames import FramePicker, browsed
from roadeval.jobs.results.inspect import WorstFrame, recording_of, worst_frames
from roadeval.jobs.results.report import PICTURED_OF_FLEET, findings_of
from roadeval.jobs.results.result import Result
from roadeval.recording.viewer import WindowViewer
from roadeval.report.blocks import Cell, Document, Heading, Table
from roadeval.report.document import page_document
from roadeval.report.page.render import Place, page, part
from roadeval.report.sections.frames import LARGE
from roadeval.results.fleet import FleetFolder
from roadeval.runtime.files import Paths, listed
from roadeval.runtime.local_server import NOT_FOUND, PAGE, LocalServer, Request, Response, told


def serve(results: Paths, on_address: Callable[[str], None]) -> None:
    """Serve results as pages on 127.0.0.1 until the process is interrupted, as by Ctrl-C.

    ``on_address`` is called with the address to open, before anything is answered: it holds a token
    without which nothing is. A `RoadevalError` if a result cannot be read.
    """
    with serving(results) as server:
        on_address(server.address)
        server.serve_forever(0.1)


@contextmanager
def serving(results: Paths) -> Iterator[LocalServer]:
    """Yield a server of results, as of `serve`; what it started ends with the block."""
    with ExitStack() as stack:
        viewer = WindowViewer()
        stack.callback(viewer.close)
        whole = [Result(path) for path in listed(results)]
        opened = [own for each in whole for own in (each, *each.cameras.values())]
        server = LocalServer(partial(_answer, [_Served(each, viewer) for each in opened]))
        stack.callback(server.server_close)
        yield server


def _answer(served: Sequence[_Served], request: Request) -> Response:
    """Return the list of results, or what lies below one; a problem of a result as its sentence."""
    try:
        match request.parts:
            case () if not request.acts:
                return _home(served)
            case (place, *rest) if place.isdecimal() and int(place) < len(served):
                return _below(served[int(place)], request, rest)
        return NOT_FOUND
    except RoadevalError as error:
        # The viewer cannot show it: that is no fault of the server.
        failed = HTTPStatus.CONFLICT if request.acts else HTTPStatus.INTERNAL_SERVER_ERROR
        return told(failed, str(error))


def _home(served: Sequence[_Served]) -> Response:
    if len(served) == 1:
        return _moved("0/")
    rows: list[list[Cell | str]] = [
        [Cell(each.title, leads=f"{place}/"), each.headline, each.written, str(each.path)]
        for place, each in enumerate(served)
    ]
    table = Table(["result", "what it says first", "written", "file"], rows, range(4))
    made = Document("roadeval", "Results", f"{len(rows)} results", "", [Heading("Results"), table])
    return _page(made, Place(frames=""))


class _Served:
    """The page of a result, and what lies below it: frames of a drive, drives of a fleet.

    ``above`` is the address and the title of the page above.
    """

    def __init__(
        self, result: Result, viewer: WindowViewer, above: tuple[str, str] = ("../", "All results")
    ) -> None:
        (self.path,) = result.paths
        drive, fleet = result.drive, result.fleet
        self.title: Final = drive.title if drive else result.name
        self._result: Final = result
        self._viewer: Final = viewer
        self._lock: Final = Lock()
        self._place: Final = Place(None if result.rig else "frame/{}", *above)
        self._frames: Final = {str(number): number for number in (drive.pictured if drive else ())}
        self._drives: Final = {str(n): name for n, name in enumerate(fleet.drives if fleet else ())}
        self._opened: Final[dict[Path, _Served]] = {}

    @property
    def headline(self) -> str:
        """The first sentence of the verdict."""
        return f"{self._result.facts.verdict.split('. ')[0].rstrip('.')}."

    @property
    def written(self) -> str:
        """When its file or folder was written, by the clock of this machine."""
        return f"{datetime.fromtimestamp(self.path.stat().st_mtime):%Y-%m-%d %H:%M}"

    def answer(self, request: Request) -> Response:
        """Return its page, a frame's pictures, a drive's page, or that the viewer shows a frame."""
        fleet = self._result.fleet
        match request.parts, request.acts:
            case (), False:
                return self._own_page
            case ("frame", number, *rest), acts if number in self._frames:
                return self._frame(self._frames[number], rest, acts=acts)
            case ("worst", rank, "view"), True if fleet and rank in self._worst:
                frame = self._worst[rank]
                return self._shown(recording_of(fleet, frame.drive), frame.frame)
            case ("drive", place, *rest), _ if fleet and place in self._drives:
                return _below(self._of(fleet, self._drives[place]), request, rest)
        return NOT_FOUND

    def _frame(self, frame: int, rest: list[str], *, acts: bool) -> Response:
        match rest, acts:
            case ["part"], False:
                with self._lock:
                    strip = self._picker.strip(frame, LARGE)
                return Response(part(strip, self._place), PAGE)
            case [], False:
                return _moved(f"../#frame-{frame}")
            case ["view"], True:
                return self._shown(self.path, frame)
        return NOT_FOUND

    def _shown(self, recording: Path, frame: int) -> Response:
        self._viewer.show(recording, frame)
        return Response(b"")

    @cached_property
    def _own_page(self) -> Response:
        drive = self._result.drive
        with self._lock:
            frames = browsed(drive) if drive else None
            made = page_document(findings_of(self._result), frames, PICTURED_OF_FLEET)
        return _page(made, self._place)

    @cached_property
    def _picker(self) -> FramePicker:
        assert self._result.drive is not None
        return FramePicker(self._result.drive, None, None)

    @cached_property
    def _worst(self) -> Mapping[str, WorstFrame]:
        """The worst frames of a fleet by their ranks; none where nothing was scored."""
        fleet = self._result.fleet
        if fleet is None or not fleet.worst:
            return {}
        return {str(each.rank): each for each in worst_frames(self._result, PICTURED_OF_FLEET)}

    def _of(self, fleet: FleetFolder, drive: str) -> _Served:
        """Return a drive as it lies in the folder now: its recording, or else its tables."""
        recording = fleet.recording(drive)
        path = recording if recording.exists() else fleet.results(drive)
        with self._lock:
            if path not in self._opened:
                self._opened[path] = _Served(Result(path), self._viewer, ("../../", self.title))
            return self._opened[path]


def _below(served: _Served, request: Request, rest: Sequence[str]) -> Response:
    """Return what is asked for below a page, whose own address ends with a slash."""
    if not rest and not request.folder:
        return _moved(f"{request.parts[-1]}/")
    return served.answer(replace(request, parts=tuple(rest)))


def _page(document: Document, place: Place) -> Response:
    """Return a page, with the policy on what it may ask for."""
    policy = f"{place.policy}; frame-ancestors 'none'"
    return Response(page(document, place), PAGE, headers={"Content-Security-Policy": policy})


def _moved(to: str) -> Response:
    """Return where the browser is to look instead."""
    return Response(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": to})
