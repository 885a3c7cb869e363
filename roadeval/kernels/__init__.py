"""The loops over every pixel that no library offers in one pass.

Each is there twice: compiled (`colours`, `shapes`), and as the NumPy or OpenCV expression that
defines it (`plain`). Both give the same bits. `KERNELS` are the compiled ones where compilation
works and the others where it does not (no compiler support, nowhere to keep the cache), so the
results never depend on the machine.
"""

from __future__ import annotations

import os
from types import ModuleType
from typing import Final

from roadeval.kernels import plain


def _pick() -> ModuleType:
    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from roadeval.kernels import compiled
    except Exception:  # whatever keeps a compiler from working, the twins give the same numbers
        return plain
    return compiled


KERNELS: Final = _pick()
