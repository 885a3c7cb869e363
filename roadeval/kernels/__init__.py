"""Loops over all pixels that no library offers in one pass.

Each exists twice: in C (`compiled`), and as the NumPy or OpenCV expression that defines it
(`plain`). Both return the same bits, so that results never depend on the machine. `KERNELS` are the
compiled ones if the library was built when the package was installed, else the plain ones. The
first use of a kernel makes the choice.
"""

from __future__ import annotations

import os
from types import ModuleType
from typing import TYPE_CHECKING, Any


def pick() -> ModuleType:
    """Return the module of the kernels in use: `compiled`, or its twin `plain`."""
    from roadeval.kernels import plain

    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from roadeval.kernels import compiled
    except ImportError:  # not built, or built from earlier sources
        return plain
    return compiled


def missing() -> bool:
    """Return whether the plain kernels are in use although nobody asked for them."""
    return os.environ.get("ROADEVAL_PLAIN") != "1" and pick().__name__.endswith(".plain")


class Kernels:
    """The kernels by name, looked up in the module that `pick` returns."""

    def __getattr__(self, name: str) -> Any:
        kernel = getattr(pick(), name)
        setattr(self, name, kernel)
        return kernel


if TYPE_CHECKING:
    # The plain twins are the definitions, their types included.
    from roadeval.kernels import plain as KERNELS  # noqa: N812
else:
    KERNELS = Kernels()
