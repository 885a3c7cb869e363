"""Imports that cost less: names on demand, and parts of libraries without the whole.

A package runs its ``__init__`` when anything inside it is imported. scikit-learn's takes a second
of computing and imports SciPy's statistics, pandas and a job scheduler, none of which its libsvm
needs; ``scipy.special`` takes a quarter of a second. `extension` puts empty packages in their
places while a compiled module is loaded, and removes them again. Whoever imports the library later
gets the whole of it, with the same compiled module in it.

No other thread may import the library meanwhile, unless by `whole`.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

_ONE_AT_A_TIME = Lock()


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


@cache
def extension(name: str, *packages: str) -> ModuleType:
    """Return a compiled module of a library; an ImportError if there is none.

    In a version of the library that is laid out in another way, its packages are imported too.
    ``name`` is the module's, as ``scipy.special._ufuncs``. ``packages`` are those that are not to
    be run, outer ones first: its own, and those of the compiled modules that it needs. One that is
    imported already stays as it is.
    """
    with _ONE_AT_A_TIME:
        if name in sys.modules:
            return sys.modules[name]
        try:
            with _empty(packages):
                return import_module(name)
        except Exception:  # whatever it is that the module misses
            return import_module(name)


def whole(name: str) -> ModuleType:
    """Return a module of a library with its packages, while no `extension` is loaded."""
    with _ONE_AT_A_TIME:
        return import_module(name)


@cache
def special(function: str) -> Any:
    """Return a function of ``scipy.special`` by its name."""
    try:
        compiled = extension("scipy.special._ufuncs", "scipy.special", "scipy.linalg")
        return getattr(compiled, function)
    except (ImportError, AttributeError):  # it lies elsewhere in this version of SciPy
        return getattr(whole("scipy.special"), function)


@contextmanager
def _empty(packages: tuple[str, ...]) -> Iterator[None]:
    """Put empty packages into ``sys.modules``; what is imported below them leaves with them.

    A compiled module that is imported a second time is the one that was loaded first.
    """
    absent = tuple(package for package in packages if package not in sys.modules)
    try:
        for package in absent:
            parent = package.rpartition(".")[0]
            found = PathFinder.find_spec(
                package, import_module(parent).__path__ if parent else None
            )
            if found is None or found.submodule_search_locations is None:
                raise ModuleNotFoundError(f"no package {package}", name=package)
            empty = ModuleSpec(package, None, is_package=True)
            empty.submodule_search_locations = found.submodule_search_locations
            sys.modules[package] = module_from_spec(empty)
        yield
    finally:
        below = tuple(f"{package}." for package in absent)
        for name in list(sys.modules):  # other threads import what they need meanwhile
            if name in absent or name.startswith(below):
                del sys.modules[name]


class _NoPandas(MetaPathFinder):
    """Finds no pandas, and leaves all else to the finders after it."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        if fullname == "pandas":
            raise ModuleNotFoundError("No module named 'pandas'", name="pandas")
        return None


def leave_out_pandas() -> None:
    """Keep Arrow from importing pandas when it is first given numbers or lists.

    That takes a fifth of a second or more, and 45 MB, for every recording. Arrow looks once; what
    needs pandas, as ``to_pandas``, imports it all the same. But pandas' own arrays count as any
    sequence then, and its missing values as any object: call this only in a process that gives
    Arrow no objects of pandas'. Where pandas is imported already, it is found.
    """
    import numpy as np
    import pyarrow as pa

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array(np.zeros(1))  # Arrow's Python looks for it
        pa.scalar(0)  # and so does its C++
    finally:
        sys.meta_path.remove(finder)
