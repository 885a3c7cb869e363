"""A viewer that is opened once and steered from frame to frame: in its own window or a browser."""

from __future__ import annotations

import re
import subprocess
from contextlib import ExitStack
from pathlib import Path
from threading import Lock
from typing import Final, Protocol
from urllib.parse import quote
from urllib.request import urlopen

from rerun.experimental import ViewerClient

from roadeval.recording import layout as at
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.screen.catalogue import CataloguedDrive, require_catalogue, served
from roadeval.recording.screen.viewer import go, has_screen, hosted, opened

FILES: Final = {
    "": "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "favicon.ico": "image/x-icon",
}
"""The files of the viewer's web build, with their media types."""
POLICY: Final = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob: http://127.0.0.1:*; frame-ancestors 'none'; form-action 'none'"
)
"""What the web build may ask for: nothing of another machine."""
_ELSEWHERE: Final = re.compile(rb"<link\b[^>]*\bhttps://[^>]*>")
"""Fonts that the web build would ask Google for; it draws its own ones."""


class SteeredViewer(Protocol):
    """Shows frames of recordings."""

    def add(self, recording: Path, name: str, layout: Layout) -> None:
        """Make a recording known under a name; one that is known stays as it is.

        Raises
        ------
        RecordingError
            If it cannot be served.
        """

    def show(self, recording: Path, frame: int) -> str:
        """Show a frame of a recording that is known.

        Returns what to add to the web build's address; empty for a window.

        Raises
        ------
        RecordingError
            If the viewer cannot work here.
        """

    def file(self, name: str) -> bytes | None:
        """Return a file of the web build, one of `FILES`; None where there is none."""

    def close(self) -> None:
        """End the viewer."""


class WindowViewer:
    """The viewer in its own window; opened again where somebody has closed it."""

    def __init__(self) -> None:
        self._stack: Final = ExitStack()
        self._lock: Final = Lock()
        self._shown: tuple[Path, subprocess.Popen[bytes], ViewerClient] | None = None

    def add(self, recording: Path, name: str, layout: Layout) -> None:
        """Do nothing: a window opens any recording."""

    def show(self, recording: Path, frame: int) -> str:
        """Show a frame, as `SteeredViewer.show`."""
        if not has_screen():
            raise RecordingError(
                "No screen to open a window on: take the web viewer, or type the command on a "
                "machine that has one."
            )
        with self._lock:
            go(self._client(recording), frame)
        return ""

    def _client(self, recording: Path) -> ViewerClient:
        """Return what steers the window, on a recording; it is opened where it is not there."""
        if self._shown is not None:
            shown, process, client = self._shown
            if shown == recording and process.poll() is None:
                return client
        self._shown = None
        self._stack.close()
        process, client = self._stack.enter_context(opened(recording))
        self._shown = recording, process, client
        return client

    def file(self, _name: str) -> None:
        """Return nothing: a window needs no web build."""

    def close(self) -> None:
        """End the viewer."""
        self._stack.close()


class BrowserViewer:
    """The viewer's web build beside the page; Rerun's catalogue leads it to a frame.

    Every recording has a catalogue of its own, on 127.0.0.1 and a port that nobody else has, until
    it is closed: one catalogue refuses two recordings of one identity.

    Raises
    ------
    RecordingError
        If the catalogue is not installed.
    """

    def __init__(self) -> None:
        require_catalogue()
        self._places: Final[dict[Path, str]] = {}
        self._files: str | None = None
        self._stack: Final = ExitStack()
        self._lock: Final = Lock()

    def add(self, recording: Path, name: str, layout: Layout) -> None:
        """Serve a recording, as `SteeredViewer.add`."""
        with self._lock:
            if recording in self._places:
                return
            drives = [CataloguedDrive(name, recording, {})]
            catalogue = self._stack.enter_context(served(name, drives, layout, ""))
            if self._files is None:
                self._files = self._stack.enter_context(hosted(catalogue.address))
            self._places[recording] = catalogue.drives[name]

    def show(self, recording: Path, frame: int) -> str:
        """Return what to add to the web build's address, as `SteeredViewer.show`."""
        place = f"{self._places[recording]}#when={at.FRAME}@{frame}"
        return f"?url={quote(place, safe='')}"

    def file(self, name: str) -> bytes | None:
        """Return a file of the web build, as `SteeredViewer.file`."""
        if name not in FILES or self._files is None:
            return None
        with urlopen(self._files + name) as answer:
            content: bytes = answer.read()
        return content if name else _ELSEWHERE.sub(b"", content)

    def close(self) -> None:
        """End the servers."""
        self._stack.close()
