"""Loops over every pixel that no library offers in one pass.

Each is there twice: compiled (`bits`, `colours`, `compensation`, `rectified`, `runs`), and as the
NumPy or OpenCV expression that defines it (`plain`). Both return the same bits. `KERNELS` are the
compiled ones where compilation works and the others where it does not (no compiler support, nowhere
to keep the cache), so results never depend on the machine. The choice is made when the first kernel
is asked for, so that commands that only read results do not import a compiler.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any


def pick() -> ModuleType:
    """Return the module of the kernels that are used: `compiled`, or its twin `plain`."""
    from roadeval.kernels import plain

    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from numba import config

        from roadeval.kernels import compiled
    except Exception:  # whatever keeps a compiler from working, the twins give the same numbers
        return plain
    return plain if config.DISABLE_JIT else compiled


def prepare(on_compile: Callable[[], None]) -> None:
    """Load the kernels, which compiles them the first time on a machine.

    Parameters
    ----------
    on_compile
        Called before the first one is compiled: it takes some ten seconds for all.
    """
    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return
    try:
        from numba.core.event import Listener, install_listener
    except Exception:  # see `pick`
        return
    waiting = [on_compile]

    class Watch(Listener):  # type: ignore[misc]
        def on_start(self, _event: Any) -> None:
            if waiting:
                waiting.pop()()

        def on_end(self, _event: Any) -> None:
            """Events come in pairs."""

    with install_listener("numba:compile", Watch()):
        pick()


class _Kernels:
    """The kernels by name, looked up in the module that `pick` returns."""

    def __getattr__(self, name: str) -> Any:
        kernel = getattr(pick(), name)
        setattr(self, name, kernel)
        return kernel


if TYPE_CHECKING:
    # The plain twins are the definitions, their types included.
    from roadeval.kernels import plain as KERNELS  # noqa: N812
else:
    KERNELS = _Kernels()
