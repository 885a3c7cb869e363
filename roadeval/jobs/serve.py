"""Results served as pages on this machine: every frame's pictures, and the viewer a click away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from functools import cached_property
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.results.frames import FramePicker, browsed
from roadeval.jobs.results.inspect import WorstFrame, recording_of, worst_frames
from roadeval.jobs.results.report import PICTURED_OF_FLEET, findings_of
from roadeval.jobs.results.result import DriveResult, Result
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
        server = LocalServer(_Site([_served(each, viewer) for each in opened]).answer)
        stack.callback(server.server_close)
        yield server


class _Site:
    """Finds what answers a request: the list of results, or one of them."""

    def __init__(self, served: list[_Served]) -> None:
        self._served: Final = served

    def answer(self, request: Request) -> Response:
        """Return what is asked for; a problem of a result as its sentence."""
        try:
            match request.parts:
                case () if not request.acts:
                    return self._home()
                case (place, *rest) if place.isdecimal() and int(place) < len(self._served):
                    return _below(self._served[int(place)], request, rest)
            return NOT_FOUND
        except RoadevalError as error:
            # The viewer cannot show it: that is no fault of the server.
            failed = HTTPStatus.CONFLICT if request.acts else HTTPStatus.INTERNAL_SERVER_ERROR
            return told(failed, str(error))

    def _home(self) -> Response:
        if len(self._served) == 1:
            return _moved("0/")
        rows: list[list[Cell | str]] = [
            [Cell(each.title, leads=f"{place}/"), each.headline, each.written, str(each.path)]
            for place, each in enumerate(self._served)
        ]
        table = Table(["result", "what it says first", "written", "file"], rows, range(4))
        made = Document(
            "roadeval", "Results", f"{len(rows)} results", "", [Heading("Results"), table]
        )
        return _page(made, Place(frames=""))


class _Served:
    """The page of a result: of a rig, or what that of a drive and of a fleet begin with."""

    def __init__(self, result: Result, place: Place) -> None:
        (self.path,) = result.paths
        self.title: Final = result.drive.title if result.drive else result.name
        self._result: Final = result
        self._lock: Final = Lock()
        self._place: Final = place

    @property
    def headline(self) -> str:
        """The first sentence of the verdict."""
        return f"{self._result.facts.verdict.split('. ')[0].rstrip('.')}."

    @property
    def written(self) -> str:
        """When its file or folder was written, by the clock of this machine."""
        return f"{datetime.fromtimestamp(self.path.stat().st_mtime):%Y-%m-%d %H:%M}"

    def answer(self, request: Request) -> Response:
        """Return what is asked for below its address."""
        return NOT_FOUND if request.parts or request.acts else self._own_page

    @cached_property
    def _own_page(self) -> Response:
        drive = self._result.drive
        with self._lock:
            frames = browsed(drive) if drive else None
            made = page_document(findings_of(self._result), frames, PICTURED_OF_FLEET)
        return _page(made, self._place)


class _ServedDrive(_Served):
    """A drive, and every frame that has pictures.

    ``above`` is the address and the title of the page above.
    """

    def __init__(
        self,
        result: Result,
        drive: DriveResult,
        viewer: WindowViewer,
        above: tuple[str, str] = ("../", "All results"),
    ) -> None:
        super().__init__(result, Place("frame/{}", *above))
        self._viewer: Final = viewer
        self._picker: Final = FramePicker(drive, None, None)
        self._frames: Final = frozenset(drive.pictured)

    def answer(self, request: Request) -> Response:
        """Return its page, the pictures of a frame, or that the viewer shows one."""
        match request.parts:
            case ("frame", number, *rest) if number.isdecimal() and int(number) in self._frames:
                return self._frame(int(number), rest, request)
        return super().answer(request)

    def _frame(self, frame: int, rest: list[str], request: Request) -> Response:
        match rest, request.acts:
            case ["part"], False:
                with self._lock:
                    strip = self._picker.strip(frame, LARGE)
                return Response(part(strip, self._place), PAGE)
            case [], False:
                return _moved(f"../#frame-{frame}")
            case ["view"], True:
                self._viewer.show(self.path, frame)
                return Response(b"")
        return NOT_FOUND


class _ServedFleet(_Served):
    """A fleet, the pages of its drives, and its worst frames in the viewer."""

    def __init__(self, result: Result, fleet: FleetFolder, viewer: WindowViewer) -> None:
        super().__init__(result, Place("frame/{}", "../"))
        self._viewer: Final = viewer
        self._fleet: Final = fleet
        self._drives: Final[dict[Path, _ServedDrive]] = {}

    def answer(self, request: Request) -> Response:
        """Return its page, that of a drive, or that the viewer shows one of the worst frames."""
        match request.parts:
            case ("worst", rank, "view") if request.acts and rank.isdecimal():
                if (frame := self._worst.get(int(rank))) is None:
                    return NOT_FOUND
                self._viewer.show(recording_of(self._fleet, frame.drive), frame.frame)
                return Response(b"")
            case ("drive", place, *rest) if place.isdecimal():
                drives = [*self._fleet.drives]
                if int(place) < len(drives):
                    return _below(self._of(drives[int(place)]), request, rest)
        return super().answer(request)

    @cached_property
    def _worst(self) -> Mapping[int, WorstFrame]:
        if not self._fleet.worst:
            return {}
        return {each.rank: each for each in worst_frames(self._result, PICTURED_OF_FLEET)}

    def _of(self, drive: str) -> _ServedDrive:
        """Return a drive as it lies in the folder now: its recording, or else its tables."""
        recording = self._fleet.recording(drive)
        path = recording if recording.exists() else self._fleet.results(drive)
        with self._lock:
            if path not in self._drives:
                opened = Result(path)
                assert opened.drive is not None
                above = "../../", self.title
                self._drives[path] = _ServedDrive(opened, opened.drive, self._viewer, above)
            return self._drives[path]


def _served(result: Result, viewer: WindowViewer) -> _Served:
    if result.fleet:
        return _ServedFleet(result, result.fleet, viewer)
    if result.drive is None:
        return _Served(result, Place(home="../"))
    return _ServedDrive(result, result.drive, viewer)


def _below(served: _Served, request: Request, rest: list[str]) -> Response:
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
