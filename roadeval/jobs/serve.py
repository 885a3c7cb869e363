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
from roadeval.jobs.result import Result
from roadeval.jobs.served import VIEWER, Served, ServedDrive, moved, policy
from roadeval.jobs.served_fleet import ServedFleet
from roadeval.recording.screen import steered
from roadeval.report.blocks import Document, Heading
from roadeval.report.browse import LinkList
from roadeval.report.findings import Commands
from roadeval.report.page.render import SCRIPT, STYLE, Place, code, page
from roadeval.results.fleet.kind import is_fleet
from roadeval.runtime.local_server import NOT_FOUND, PAGE, LocalServer, Request, Response, told
from roadeval.runtime.paths import Paths, listed

MakeCommands = Callable[[Result | Path], Commands]
"""Returns the commands that a page names, of a drive's result or of a fleet's folder."""
_CODE: Final = {STYLE: "text/css; charset=utf-8", SCRIPT: "text/javascript; charset=utf-8"}
_PLACE: Final = Place("", "", "{}")


def serve(
    results: Paths,
    on_address: Callable[[str], None],
    *,
    web: bool = False,
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
    web
        Whether frames open in the viewer's web build, in the browser, and not in a window.
    commands
        Makes the commands that pages name; none by default.

    Raises
    ------
    RoadevalError
        If a result cannot be read, or the web viewer cannot be had.
    """
    with serving(results, web=web, commands=commands) as server:
        on_address(server.address)
        server.serve()


@contextmanager
def serving(
    results: Paths,
    *,
    web: bool = False,
    commands: MakeCommands | None = None,
) -> Iterator[LocalServer]:
    """Have a server of results, as `serve`; when the block ends, all that it started ends with it.

    Yields
    ------
    LocalServer
        Its ``serve`` answers.
    """
    with ExitStack() as stack:
        replayer = Replayer()
        opened = [_opened(Path(path), commands, replayer) for path in listed(results)]
        viewer = steered.BrowserViewer() if web else steered.WindowViewer()
        stack.callback(viewer.close)
        for each in opened:
            each.begin(viewer)
        stack.callback(replayer.cancel)
        server = LocalServer(_Site(opened, viewer).answer)
        stack.callback(server.close)
        yield server


def _opened(path: Path, commands: MakeCommands | None, replayer: Replayer) -> Served:
    if is_fleet(path):
        inspect = commands(path).inspect if commands else None
        return ServedFleet(path, inspect, commands, replayer)
    return ServedDrive(path, commands)


class _Site:
    """Finds what answers a request: the list of results, one of them, or the web viewer."""

    def __init__(self, served: Sequence[Served], viewer: steered.SteeredViewer) -> None:
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
            case (first, *rest) if first == VIEWER and not request.acts and len(rest) < 2:
                return self._viewer_file("".join(rest))
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

    def _viewer_file(self, name: str) -> Response:
        content = self._viewer.file(name)
        if content is None:
            return NOT_FOUND
        allowed = {"Content-Security-Policy": steered.POLICY}
        return Response(content, steered.FILES[name], headers=allowed, kept=bool(name))
