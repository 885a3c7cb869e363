"""Paths as callers of the public functions give them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

AnyPath = str | Path
Paths = AnyPath | Sequence[AnyPath]
"""One path, or some."""


def listed(paths: Paths) -> list[AnyPath]:
    """Return one path or some as a list; a text is a path, not a sequence of letters."""
    return [paths] if isinstance(paths, str | Path) else list(paths)
