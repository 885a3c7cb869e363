"""Results served as pages on this machine: every frame's pictures, and the viewer a click away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.result import Result
from roadeval.jobs.served import Served, ServedDrive, ServedFleet
from roadeval.recording import Recording
from roadeval.recording.screen import steered
from roadeval.report.blocks import Document, Heading
from roadeval.report.browse import LinkList
from roadeval.report.findings import Commands
from roadeval.report.page.render import SCRIPT, STYLE, Place, code, page
from roadeval.results.fleet.kind import is_fleet
from roadeval.runtime.local_server import NOT_FOUND, PAGE, LocalServer, Request, Response, told

MakeCommands = Callable[[Result | Path], Commands]
"""Returns the commands that a page names, of a drive's result or of a fleet's folder."""
_CODE: Final = {STYLE: "text/css; charset=utf-8", SCRIPT: "text/javascript; charset=utf-8"}
_PLACE: Final = Place("", "", "{}")


@contextmanager
def serving(
    results: Sequence[str | Path],
    *,
    web: bool = False,
    commands: MakeCommands | None = None,
) -> Iterator[LocalServer]:
    """Serve results on 127.0.0.1; when the block ends, all that was started ends with it.

    Parameters
    ----------
    results
        Recordings, results folders and fleets.
    web
        Whether frames open in the viewer's web build, in the browser, and not in a window.
    commands
        Makes the commands that pages name; none by default.

    Yields
    ------
    LocalServer
        Its address holds a token without which nothing is answered; its ``serve`` answers.

    Raises
    ------
    RoadevalError
        If a result cannot be read, or the web viewer cannot be had.
    """
    opened = [_opened(Path(path), commands) for path in results]
    viewer = _viewer(opened) if web else steered.WindowViewer()
    try:
        server = LocalServer(_Site(opened, viewer).answer)
        try:
            yield server
        finally:
            server.close()
    finally:
        viewer.close()


def _opened(path: Path, commands: MakeCommands | None) -> Served:
    if is_fleet(path):
        return ServedFleet(path, commands(path).inspect if commands else None)
    return ServedDrive(path, commands)


def _viewer(opened: Sequence[Served]) -> steered.BrowserViewer:
    """Return the web viewer for every recording; those of one result share a layout."""
    groups = [
        (Recording(next(iter(each.recordings))).layout, each.recordings)
        for each in opened
        if each.recordings
    ]
    if not groups:
        raise RoadevalError("there is no recording among the results that the viewer could open")
    return steered.BrowserViewer(groups)


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
            case ("viewer", *rest) if not request.acts and len(rest) < 2:
                return self._viewer_file("".join(rest))
            case (place, *rest) if place.isdecimal() and int(place) < len(self._served):
                if not rest and not request.folder:
                    return _moved(f"{place}/")
                below = replace(request, parts=tuple(rest))
                return self._served[int(place)].answer(below, self._viewer)
        return NOT_FOUND

    def _home(self) -> Response:
        if len(self._served) == 1:
            return _moved("0/")
        links = [
            (f"{each.title} ({each.path})", f"{place}/") for place, each in enumerate(self._served)
        ]
        blocks = [Heading("Results"), LinkList(links)]
        made = Document("roadeval", "Results", f"{len(links)} results", "", blocks)
        policy = {"Content-Security-Policy": f"{_PLACE.policy}; frame-ancestors 'none'"}
        return Response(page(made, _PLACE), PAGE, headers=policy)

    def _viewer_file(self, name: str) -> Response:
        content = self._viewer.file(name)
        if content is None:
            return NOT_FOUND
        policy = {"Content-Security-Policy": steered.POLICY}
        return Response(content, steered.FILES[name], headers=policy, kept=bool(name))


def _moved(to: str) -> Response:
    return Response(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": to})
