"""Picks, once, the compiled kernels where they compile and their NumPy twins where they do not."""

from __future__ import annotations

import os
from types import ModuleType
from typing import Final

from roadeval.pipeline import plain


def _pick() -> ModuleType:
    if os.environ.get("ROADEVAL_PLAIN") == "1":
        return plain
    try:
        from roadeval.pipeline import kernels
    except Exception:  # whatever keeps a compiler from working, the twins give the same numbers
        return plain
    return kernels


KERNELS: Final = _pick()
