"""Results served as pages on this machine: every frame's pictures, and the viewer a click away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.replayed import Replayer
from roadeval.jobs.result import DriveResult
from roadeval.jobs.served import Served, ServedDrive, moved, policy
from roadeval.jobs.served_fleet import ServedFleet
from roadeval.recording.screen.viewer import WindowViewer
from roadeval.report.blocks import Document, Heading, LinkList
from roadeval.report.findings import Commands
from roadeval.report.page.render import SCRIPT, STYLE, Place, code, page
from roadeval.results.fleet.kind import is_fleet
from roadeval.runtime.files import Paths, listed
from roadeval.runtime.local_server import NOT_FOUND, PAGE, LocalServer, Request, Response, told

MakeCommands = Callable[[DriveResult | Path], Commands]
"""Returns the commands that a page names, of a drive's result or of a fleet's folder."""
_CODE: Final = {STYLE: "text/css; charset=utf-8", SCRIPT: "text/javascript; charset=utf-8"}
_PLACE: Final = Place("", "", "{}")


def serve(
    results: Paths,
    on_address: Callable[[str], None],
    *,
    trust_sources: bool = False,
    commands: MakeCommands | None = None,
) -> None:
    """Serve results as pages on 127.0.0.1 until the process is told to end, as by Ctrl-C.

    Parameters
    ----------
    results
        Recordings, results folders and fleets.
    on_address
        Called with the address to open, before anything is answered. It holds a token without which
        nothing is answered.
    trust_sources
        Whether a fleet's drives may be replayed from where its folder says that their logs lie.
    commands
        Makes the commands that pages name; none by default.

    Raises
    ------
    RoadevalError
        If a result cannot be read.
    """
    with serving(results, trust_sources=trust_sources, commands=commands) as server:
        on_address(server.address)
        server.serve_forever(0.1)


@contextmanager
def serving(
    results: Paths, *, trust_sources: bool = False, commands: MakeCommands | None = None
) -> Iterator[LocalServer]:
    """Have a server of results, as `serve`; when the block ends, all that it started ends with it.

    Yields
    ------
    LocalServer
        Its ``serve_forever`` answers.
    """
    with ExitStack() as stack:
        replayer = Replayer()
        opened = [
            _opened(Path(path), commands, replayer, trust_sources=trust_sources)
            for path in listed(results)
        ]
        viewer = WindowViewer()
        stack.callback(viewer.close)
        stack.callback(replayer.cancel)
        server = LocalServer(_Site(opened, viewer).answer)
        stack.callback(server.server_close)
        yield server


def _opened(
    path: Path, commands: MakeCommands | None, replayer: Replayer, *, trust_sources: bool
) -> Served:
    if is_fleet(path):
        inspect = commands(path).inspect if commands else None
        return ServedFleet(path, inspect, commands, replayer, trust_sources=trust_sources)
    return ServedDrive(path, commands)


class _Site:
    """Finds what answers a request: the list of results, or one of them."""

    def __init__(self, served: Sequence[Served], viewer: WindowViewer) -> None:
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
            case (place, *rest) if place.isdecimal() and int(place) < len(self._served):
                if not rest and not request.folder:
                    return moved(f"{place}/")
                below = replace(request, parts=tuple(rest))
                return self._served[int(place)].answer(below, self._viewer)
        return NOT_FOUND

    def _home(self) -> Response:
        if len(self._served) == 1:
            return moved("0/")
        links = [
            (f"{each.title} ({each.path})", f"{place}/") for place, each in enumerate(self._served)
        ]
        blocks = [Heading("Results"), LinkList(links)]
        made = Document("roadeval", "Results", f"{len(links)} results", "", blocks)
        return Response(page(made, _PLACE), PAGE, headers=policy(_PLACE))
