"""Names of packages, imported when they are first used."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def on_demand(package: str) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that imports its public names when they are used.

    They are those that its source imports under ``if TYPE_CHECKING``.
    """

    def find(name: str) -> Any:
        home = _homes(package).get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home), name)

    return find


@cache
def _homes(package: str) -> Mapping[str, str]:
    """Return the module of each name that the source of a package imports in a block."""
    source = Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8")
    blocks = [each for each in ast.parse(source).body if isinstance(each, ast.If)]
    imports = [each for block in blocks for each in block.body if isinstance(each, ast.ImportFrom)]
    return {name.name: each.module or "" for each in imports for name in each.names}
