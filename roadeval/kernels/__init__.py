"""The loops over every pixel that no library offers in one pass.

Each is there twice: compiled (`bits`, `colours`, `machine`, `runs`, `shades`), and as the NumPy or
OpenCV expression that defines it (`plain`). Both give the same bits. `KERNELS` are the compiled
ones where compilation works and the others where it does not (no compiler support, nowhere to keep
the cache), so the results never depend on the machine. Which they are is found out when the first
one is asked for: whoever only reads results need not wait for a compiler.
"""

from __future__ import annotations

import os
from types import ModuleType
from typing import Any, Final


def pick() -> ModuleType:
    """Give the module of the kernels that are used: `compiled`, or its twin `plain`."""
    from roadeval.kernels import plain

    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from numba import config

        from roadeval.kernels import compiled
    except Exception:  # whatever keeps a compiler from working, the twins give the same numbers
        return plain
    return plain if config.DISABLE_JIT else compiled


class _Kernels:
    """Gives the kernels by name."""

    def __getattr__(self, name: str) -> Any:
        kernels = pick()
        for known in vars(kernels):
            if not known.startswith("__"):
                setattr(self, known, getattr(kernels, known))
        return object.__getattribute__(self, name)


KERNELS: Final = _Kernels()
