"""Results served as pages on this machine: every frame's pictures, and the viewer a click away."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from functools import cached_property, partial
from http import HTTPStatus
from itertools import combinations
from pathlib import Path
from threading import Lock
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.progress import OnProgress
from roadeval.jobs.results.compare import as_page, compare
from roadeval.jobs.results.frames import FramePicker, browsed
from roadeval.jobs.results.inspect import WorstFrame, worst_frames
from roadeval.jobs.results.report import PICTURED_OF_FLEET, findings_of
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.jobs.serve.replayed import CancelledReplayError, Replayer, recording_of
from roadeval.recording.viewer import WindowViewer
from roadeval.report.blocks import Cell, Document, Heading, LinkList, Strip, Table
from roadeval.report.document import page_document
from roadeval.report.page.render import SCRIPT, STYLE, Place, code, page, part
from roadeval.report.sections.frames import LARGE
from roadeval.results.fleet import FleetFolder
from roadeval.runtime.files import Paths, listed, own_names
from roadeval.runtime.local_server import NOT_FOUND, PAGE, LocalServer, Request, Response, told

PAIRS: Final = 20
"""Pairs of results that the list of results offers to compare."""
STRIPS: Final = 40
"""Frames whose pictures are kept in memory."""
_CODE: Final = {STYLE: "text/css; charset=utf-8", SCRIPT: "text/javascript; charset=utf-8"}
_MEDIA: Final = {"jpg": "image/jpeg", "png": "image/png", "svg": "image/svg+xml"}
_HOME: Final = Place("", "", "{}")


def serve(
    results: Paths, on_address: Callable[[str], None], *, trust_sources: bool = False
) -> None:
    """Serve results as pages on 127.0.0.1 until the process is interrupted, as by Ctrl-C.

    ``on_address`` is called with the address to open, before anything is answered: it holds a token
    without which nothing is. With ``trust_sources`` a fleet's drives may be replayed from where its
    folder says that their logs lie. A `RoadevalError` if a result cannot be read.
    """
    with serving(results, trust_sources=trust_sources) as server:
        on_address(server.address)
        server.serve_forever(0.1)


@contextmanager
def serving(results: Paths, *, trust_sources: bool = False) -> Iterator[LocalServer]:
    """Yield a server of results, as of `serve`; what it started ends with the block."""
    with ExitStack() as stack:
        replayer, viewer = Replayer(), WindowViewer()
        whole = [Result(path, trust_sources=trust_sources) for path in listed(results)]
        opened = [own for each in whole for own in (each, *each.cameras.values())]
        site = _Site([_served(each, replayer) for each in opened], viewer)
        stack.callback(viewer.close)
        stack.callback(replayer.close)
        server = LocalServer(site.answer)
        stack.callback(server.server_close)
        yield server


class _Site:
    """Finds what answers a request: the list of results, or one of them."""

    def __init__(self, served: list[_Served], viewer: WindowViewer) -> None:
        self._served = served
        self._viewer = viewer

    def answer(self, request: Request) -> Response:
        """Return what is asked for; a problem of a result as its sentence."""
        try:
            return self._found(request)
        except RoadevalError as error:
            return told(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))

    def _found(self, request: Request) -> Response:
        match request.parts:
            case () if not request.acts:
                return self._home()
            case (name,) if name in _CODE and not request.acts:
                return Response(code()[name], _CODE[name])
            case ("compare", base, new) if not request.acts and self._has(base) and self._has(new):
                return self._compared(int(base), int(new))
            case (place, *rest) if self._has(place):
                if not rest and not request.folder:
                    return _moved(f"{place}/")
                below = replace(request, parts=tuple(rest))
                return self._served[int(place)].answer(below, self._viewer)
        return NOT_FOUND

    def _has(self, place: str) -> bool:
        return place.isdecimal() and int(place) < len(self._served)

    def _home(self) -> Response:
        if len(self._served) == 1:
            return _moved("0/")
        rows: list[list[Cell | str]] = [
            [Cell(each.title, leads=f"{place}/"), each.headline, each.written, str(each.path)]
            for place, each in enumerate(self._served)
        ]
        pairs = [
            (
                f"{self._served[new].path} against {self._served[base].path}",
                f"compare/{base}/{new}",
            )
            for base, new in combinations(range(len(rows)), 2)
            if self._served[base].path != self._served[new].path
        ]
        blocks = [
            Heading("Results"),
            Table(["result", "what it says first", "written", "file"], rows, range(4)),
            Heading("Compare two"),
            LinkList(pairs[:PAIRS]),
        ]
        made = Document("roadeval", "Results", f"{len(rows)} results", "", blocks)
        return _page(page(made, _HOME), _HOME)

    def _compared(self, base: int, new: int) -> Response:
        found = compare([self._served[place].path for place in (base, new)])
        return _page(as_page(found, home="../../"), Place())


def _served(result: Result, replayer: Replayer) -> _Served:
    if result.fleet:
        return _ServedFleet(result, result.fleet, replayer)
    if result.drive is None:
        return _Served(result, Place("pictures/", "../", None, "../"))
    return _ServedDrive(result, result.drive)


class _Served:
    """The page of a result, with its pictures."""

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

    def answer(self, request: Request, viewer: WindowViewer) -> Response:
        """Return what is asked for below its address."""
        match request.parts:
            case () if not request.acts:
                return _page(self._page, self._place)
            case ("pictures", name) if not request.acts:
                content = self._picture(name)
                media = _MEDIA.get(name.rpartition(".")[2], "")
                return Response(content, media, kept=True) if content else NOT_FOUND
        return self._more(request, viewer)

    @cached_property
    def _document(self) -> Document:
        drive = self._result.drive
        with self._lock:
            frames = browsed(drive) if drive else None
            return page_document(findings_of(self._result), frames, PICTURED_OF_FLEET)

    @cached_property
    def _page(self) -> bytes:
        return page(self._document, self._place)

    @cached_property
    def _pictures(self) -> Mapping[str, bytes]:
        return self._document.files()

    def _picture(self, name: str) -> bytes | None:
        return self._pictures.get(name)

    def _more(self, request: Request, viewer: WindowViewer) -> Response:  # noqa: ARG002
        """Answer below the page."""
        return NOT_FOUND


class _ServedDrive(_Served):
    """A drive, and every frame that has pictures.

    ``site`` is the address of the whole site as its page names it, ``above`` the address and the
    title of the page above.
    """

    def __init__(
        self,
        result: Result,
        drive: DriveResult,
        site: str = "../",
        above: tuple[str, str] = ("../", "All results"),
    ) -> None:
        super().__init__(result, Place("pictures/", site, "frame/{}", *above))
        self._drive: Final = drive
        self._strips: Final[OrderedDict[int, Strip]] = OrderedDict()
        self._frames: Final = frozenset(drive.pictured)

    def _more(self, request: Request, viewer: WindowViewer) -> Response:
        match request.parts:
            case ("frame", number, *rest) if number.isdecimal() and int(number) in self._frames:
                return self._frame(int(number), tuple(rest), viewer, acts=request.acts)
        return NOT_FOUND

    @cached_property
    def _picker(self) -> FramePicker:
        return FramePicker(self._drive, None, None)

    def _picture(self, name: str) -> bytes | None:
        with self._lock:
            strips = [*self._strips.values()]
        found = next((i for each in strips for i in each.images() if i.name == name), None)
        return found.content if found else super()._picture(name)

    def _strip(self, frame: int) -> Strip:
        with self._lock:
            if frame not in self._strips:
                self._strips[frame] = self._picker.strip(frame, LARGE)
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
                return _moved(f"../#frame-{frame}")
            case ("view",), True:
                return _viewed(viewer, self.path, frame)
        return NOT_FOUND


class _ServedFleet(_Served):
    """A fleet, the pages of its drives, and its worst frames in the viewer."""

    def __init__(self, result: Result, fleet: FleetFolder, replayer: Replayer) -> None:
        super().__init__(result, Place("pictures/", "../", "frame/{}", "../"))
        self._fleet: Final = fleet
        self._replayer: Final = replayer
        self._drives: Final[dict[Path, _ServedDrive]] = {}

    def _more(self, request: Request, viewer: WindowViewer) -> Response:
        match request.parts:
            case ("worst", rank, "view") if request.acts and rank.isdecimal():
                frame = self._worst.get(int(rank))
                return self._view(frame, viewer) if frame else NOT_FOUND
            case ("drive", place, *rest) if place.isdecimal() and int(place) < len(
                self._fleet.drives
            ):
                if not rest and not request.folder:
                    return NOT_FOUND
                below = replace(request, parts=tuple(rest))
                return self._served([*self._fleet.drives][int(place)]).answer(below, viewer)
        return NOT_FOUND

    @cached_property
    def _worst(self) -> Mapping[int, WorstFrame]:
        if not self._fleet.worst:
            return {}
        return {each.rank: each for each in worst_frames(self._result, PICTURED_OF_FLEET)}

    def _served(self, drive: str) -> _ServedDrive:
        """Return a drive as it lies in the folder now: its recording, or else its tables."""
        recording = self._fleet.recording(drive)
        path = recording if recording.exists() else self._fleet.results(drive)
        with self._lock:
            if path not in self._drives:
                opened, above = Result(path), ("../../", self.title)
                assert opened.drive is not None
                self._drives[path] = _ServedDrive(opened, opened.drive, "../../../", above)
            return self._drives[path]

    def _view(self, frame: WorstFrame, viewer: WindowViewer) -> Response:
        """Show one of the worst frames; its drive is replayed where no recording was kept."""
        drive = frame.drive
        try:
            recording = self._fleet.recording(drive)
            state = self._replayer.want(recording, drive, partial(self._replay, drive))
            if state:
                return told(HTTPStatus.ACCEPTED, state)
        except RoadevalError as error:
            return told(HTTPStatus.CONFLICT, str(error))
        return _viewed(viewer, recording, frame.frame)

    def _replay(self, drive: str, on_progress: OnProgress) -> None:
        """Make a drive's recording; nothing is left of one that is cancelled."""
        try:
            recording_of(self._fleet, drive, on_progress)
        except CancelledReplayError:
            for left in own_names(self._fleet.recording(drive), hidden=False):
                left.unlink(missing_ok=True)
            raise


def _viewed(viewer: WindowViewer, recording: Path, frame: int) -> Response:
    """Show a frame in the viewer; the answer is empty, or says why it cannot be shown."""
    try:
        viewer.show(recording, frame)
    except RoadevalError as error:
        return told(HTTPStatus.CONFLICT, str(error))
    return Response(b"")


def _page(content: bytes, place: Place) -> Response:
    """Return a page, with the policy on what it may ask for."""
    policy = f"{place.policy}; frame-ancestors 'none'"
    return Response(content, PAGE, headers={"Content-Security-Policy": policy})


def _moved(to: str) -> Response:
    """Return where the browser is to look instead."""
    return Response(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": to})
