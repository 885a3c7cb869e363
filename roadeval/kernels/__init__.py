"""Loops over every pixel that no library offers in one pass.

Each is there twice: in C (`compiled`), and as the NumPy or OpenCV expression that defines it
(`plain`). Both return the same bits. `KERNELS` are the compiled ones where the library was built
when the package was installed, and the others elsewhere, so results never depend on the machine.
The choice is made when the first kernel is asked for.
"""

from __future__ import annotations

import os
from types import ModuleType
from typing import TYPE_CHECKING, Any


def pick() -> ModuleType:
    """Return the module of the kernels that are used: `compiled`, or its twin `plain`."""
    from roadeval.kernels import plain

    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from roadeval.kernels import compiled
    except ImportError:  # not built, or of an earlier state of the sources
        return plain
    return compiled


def missing() -> bool:
    """Return whether the twins are used although nobody asked for them."""
    return os.environ.get("ROADEVAL_PLAIN") != "1" and pick().__name__.endswith(".plain")


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
