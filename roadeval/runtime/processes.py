"""Work in processes of our own, which take with them what they imported and left in memory.

scikit-learn is there for a second and keeps 100 MiB, with all that it imports, for as long as its
process lives; a replay lives for hours. So a module whose functions take arrays and give arrays can
be run as a process that serves them (`serve`), and be called there (`call`) by those who have it
started (`elsewhere`). Where no process can be started or it ends too soon, or where what the module
names as ``LIBRARY`` is imported anyway, the functions run here, and give the same.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from importlib import import_module
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import IO, Any, Final, ParamSpec
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

Arrays = Mapping[str, npt.NDArray[Any]]
P = ParamSpec("P")
"""Of a function that takes and gives arrays by name. A number or a word is an array without
dimensions where it comes from another process."""

_NAME: Final = "function"
"""Stands beside the arrays in a message, and names no argument."""
_PREFIX: Final = 8
"""Bytes that tell the length of a message."""
_GREATEST: Final = 1 << 32
"""No message is as long; but a word reads so, if something else writes between them."""


def start(module: str) -> subprocess.Popen[bytes]:
    """Start a module of this package as a program, with pipes to it and from it.

    It imports from where this process does. A Ctrl-C at a POSIX terminal does not reach it: whoever
    started it ends it.

    Raises
    ------
    OSError
        If no process can be started, as from a program that Python is built into, or it could not
        be told where to import from.
    """
    program = Path(sys.executable or "").stem.lower()
    if getattr(sys, "frozen", False) or not program.startswith(("python", "pypy")):
        raise OSError("there is no Python to start")
    if any(os.pathsep in place for place in sys.path):
        raise OSError("a place to import from cannot be named in a list of them")
    places = os.pathsep.join(map(os.path.abspath, sys.path))
    return subprocess.Popen(
        # -P: nothing is imported from the working folder unless this process would do so.
        [sys.executable, "-P", "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": places},
        start_new_session=True,
    )


class _Helper:
    """A process that serves a module's functions."""

    def __init__(self, module: str) -> None:
        self._process = start(module)

    def ask(self, function: str, given: Mapping[str, Any]) -> Arrays | None:
        """Let it call a function; None if it could not, now or before."""
        to, back = self._process.stdin, self._process.stdout
        if self._process.returncode is not None or to is None or back is None:
            return None
        found = None
        try:
            # A process that is gone cannot be sent anything; what it has said can be read.
            with suppress(OSError):
                _send(to, {_NAME: function, **given})
            found = _receive(back)
        finally:
            if found is None:
                self.end()
        return found

    def end(self) -> None:
        """End it, whatever it is doing."""
        if self._process.returncode is None:
            self._process.kill()
            self._process.communicate()


_HELPERS: ContextVar[Mapping[str, _Helper]] = ContextVar("_HELPERS")


@contextmanager
def elsewhere(module: ModuleType) -> Iterator[None]:
    """Call the functions of a module in a process of its own, in this context.

    It starts at once: what it imports is there when it is first asked.
    """
    with ExitStack() as ends:
        if module.LIBRARY not in sys.modules:
            with suppress(OSError):
                helper = _Helper(module.__name__)
                ends.callback(helper.end)
                before = _HELPERS.set({**_HELPERS.get({}), module.__name__: helper})
                ends.callback(_HELPERS.reset, before)
        yield


def call(function: Callable[P, Arrays], *args: P.args, **given: P.kwargs) -> Arrays:
    """Call a function in its module's process if this context has one, or else here.

    Arguments without a name are not sent anywhere: with one, it is called here.

    Raises
    ------
    Exception
        Whatever the function raises.
    """
    helper = _HELPERS.get({}).get(function.__module__)
    found = None if helper is None or args else helper.ask(function.__name__, given)
    return function(*args, **given) if found is None else found


def serve(library: str, *functions: Callable[..., Arrays]) -> None:
    """Call functions for the process that started this one, until it asks for no more.

    The library that they need is imported first: whoever asks is not ready yet. If a function fails
    this process ends, and the other finds out by itself what went wrong.
    """
    import_module(library)
    known = {function.__name__: function for function in functions}
    while (given := _receive(sys.stdin.buffer)) is not None:
        arrays = dict(given)
        try:
            found = known[str(arrays.pop(_NAME))](**arrays)
        except Exception:
            return
        _send(sys.stdout.buffer, found)


def _send(to: IO[bytes], arrays: Mapping[str, Any]) -> None:
    packed = BytesIO()
    np.savez(packed, **arrays)
    to.write(packed.tell().to_bytes(_PREFIX))
    to.write(packed.getbuffer())
    to.flush()


def _receive(back: IO[bytes]) -> Arrays | None:
    """Read a message; None at the end of all, or where there is something else."""
    length = int.from_bytes(back.read(_PREFIX))
    packed = back.read(length) if length < _GREATEST else b""
    if not packed or len(packed) < length:
        return None
    try:
        with np.load(BytesIO(packed), allow_pickle=False) as arrays:
            return dict(arrays)
    except (ValueError, BadZipFile):
        return None
