"""The viewer at a given frame: in its own window, or as a screenshot without any screen.

Everything stays on this machine: the viewer listens on 127.0.0.1 alone, on a free port, and its
usage statistics are off.
"""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

from roadeval.recording import layout as at
from roadeval.recording.layout import RecordingError
from roadeval.runtime import files

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

SIZE: Final = (1920, 1080)
"""Size of a screenshot in pixels; the recording's views are arranged for it."""
PACKAGE: Final = "mesa-vulkan-drivers"
"""The Debian package of the driver that draws without a graphics card."""
DRIVERS: Final = Path("/usr/share/vulkan/icd.d")
LOADING_S: Final = 120.0
_SETTLING_S: Final = 2.0
"""Seconds to wait for a recording, and for the drawing: after a jump images are decoded first."""
_POLL_S: Final = 0.25

Answer = TypeVar("Answer")


def show(recording: Path, frame: int | None = None) -> None:
    """Open a recording in the viewer, paused at a frame, and wait until its window is closed.

    Without a frame the recording's own arrangement decides. A `RecordingError` if there is no
    screen, or the viewer does not start.
    """
    if not has_screen():
        remedy = "open it on a machine with a screen, or take a screenshot"
        raise RecordingError("no screen to show it on", where=recording, remedy=remedy)
    with open_viewer(recording) as (process, client):
        go_to(client, frame)
        process.wait()


def has_screen() -> bool:
    """Return whether a window can be opened here."""
    return os.name != "posix" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))


def screenshot(recording: Path, picture: Path, frame: int | None = None) -> int | None:
    """Write a PNG file of the viewer's window, without a screen; return the frame that it reports.

    A `RecordingError` if there is no graphics driver that works without a screen, the viewer does
    not draw, or the picture cannot be written.
    """
    width, height = SIZE
    options = ["--headless", "--window-size", f"{width}x{height}"]
    driver: dict[str, str] = {}
    if "VK_ICD_FILENAMES" not in os.environ and os.name == "posix":
        # The software driver draws the same everywhere.
        if not (drivers := sorted(DRIVERS.glob("lvp_icd*.json"))):
            remedy = f"on Debian or Ubuntu: apt-get install {PACKAGE}"
            raise RecordingError("no graphics driver that draws without a screen", remedy=remedy)
        driver["VK_ICD_FILENAMES"] = str(drivers[0])
    # The viewer reads a user's own settings from these folders; a screenshot has none.
    with tempfile.TemporaryDirectory() as home:
        environment = {**driver, "XDG_DATA_HOME": home, "XDG_RUNTIME_DIR": home}
        with open_viewer(recording, options, **environment) as (_, client):
            shown = go_to(client, frame)
            time.sleep(_SETTLING_S)
            png = ask(client.take_screenshot)
    with files.writing(picture, RecordingError):
        files.put(picture, png)
    return shown


@contextmanager
def open_viewer(
    recording: Path, options: Sequence[str] = (), **environment: str
) -> Iterator[tuple[subprocess.Popen[bytes], ViewerClient]]:
    """Start the viewer on a recording; it ends with the block."""
    import rerun_cli

    with socket.socket() as probe:  # the system chooses a free port
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    # The program itself: the command on ``PATH`` is a wrapper, which would leave it running.
    folder = Path(rerun_cli.__file__).parent
    program = next(path for path in (folder / "rerun", folder / "rerun.exe") if path.exists())
    address = ["--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            [str(program), *address, *options, str(recording)],
            stdout=log,
            stderr=log,
            # With CI set the viewer sends no usage statistics.
            env={**os.environ, "CI": "1", "NO_COLOR": "1", **environment},
        )
        try:
            yield process, _connect(process, port, log.fileno())
        finally:
            process.terminate()
            process.wait()


def _connect(process: subprocess.Popen[bytes], port: int, log: int) -> ViewerClient:
    """Return a client of the viewer as soon as it has the whole recording."""
    from rerun.experimental import ViewerClient

    deadline = time.monotonic() + LOADING_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            os.lseek(log, 0, os.SEEK_SET)
            lines = os.read(log, 1 << 20).decode(errors="replace").strip().split("\n")
            last = lines[-1].strip() or "it printed nothing"
            raise RecordingError(f"the viewer did not start: {last}")
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            state = client.get_state()
        except (OSError, RuntimeError):
            state = None
        if state and not state.loading and any(shown.timelines for shown in state.recordings):
            return client
        time.sleep(_POLL_S)
    raise RecordingError(f"the viewer did not load the recording within {LOADING_S:.0f} s")


def ask(request: Callable[[], Answer]) -> Answer:
    """Return the viewer's answer to a request, which is repeated after a timeout.

    Rerun's own timeout is 15 seconds; by then a busy machine may not have drawn once. A
    `RecordingError` if it does not answer in time, or has ended.
    """
    deadline = time.monotonic() + LOADING_S
    while True:
        try:
            return request()
        except TimeoutError as error:
            if time.monotonic() > deadline:
                problem = f"the viewer did not answer within {LOADING_S:.0f} s"
                raise RecordingError(problem) from error
        except (OSError, RuntimeError) as error:
            raise RecordingError(f"the viewer has ended: {error}") from error


def go_to(client: ViewerClient, frame: int | None) -> int | None:
    """Move the viewer to a frame; return the frame that it then reports.

    A `RecordingError` if it does not answer, see `ask`.
    """
    if frame is not None:
        ask(lambda: client.set_time(at.FRAME, sequence=frame, play_state="paused"))
    deadline = time.monotonic() + _SETTLING_S
    while True:
        shown = ask(client.get_state).recordings[0]
        reached = shown.current_time if shown.current_timeline == at.FRAME else None
        if frame in (None, reached) or time.monotonic() > deadline:
            return reached
        time.sleep(_POLL_S)
