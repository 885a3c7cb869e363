"""Compiled modules of a library, imported without the packages that they lie in.

A package runs its ``__init__`` when anything inside it is imported. scikit-learn's takes a second
of computing and imports SciPy's statistics, pandas and a job scheduler, none of which its libsvm
needs; SciPy's of ``special`` take a quarter of a second. `extension` puts empty packages in their
places while the compiled module is loaded, and takes them away again: whoever imports the library
later gets the whole of it, and the very same compiled module in it.

No other thread may import the library while that happens, unless by `whole`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import module_from_spec
from threading import Lock
from types import ModuleType
from typing import Any

_ONE_AT_A_TIME = Lock()


@cache
def extension(name: str, *packages: str) -> ModuleType:
    """Return a compiled module of a library.

    Where it cannot be had without its packages, as in a version of the library that is laid out in
    another way, they are imported with it: that is the same module, later.

    Parameters
    ----------
    name
        Of the module, as ``scipy.special._ufuncs``. One that is imported already is returned.
    packages
        Those that are not to be run, outer ones first: the module's own, and those of the compiled
        modules that it needs in turn. One that is imported already stays as it is.

    Raises
    ------
    ImportError
        If the library has no such module.
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
    """Return a module of a library with its packages, while none stands empty for `extension`."""
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
    """Put empty packages into ``sys.modules``; what was imported below them leaves with them.

    A compiled module that is imported a second time, now with its packages, is the one that was
    loaded the first time.
    """
    absent = tuple(package for package in packages if package not in sys.modules)
    try:
        for package in absent:
            sys.modules[package] = _package(package)
        yield
    finally:
        below = tuple(f"{package}." for package in absent)
        for name in list(sys.modules):  # other threads import what they need meanwhile
            if name in absent or name.startswith(below):
                del sys.modules[name]


def _package(name: str) -> ModuleType:
    """Return a package whose modules are found and whose ``__init__`` has not run."""
    parent = name.rpartition(".")[0]
    found = PathFinder.find_spec(name, import_module(parent).__path__ if parent else None)
    if found is None or found.submodule_search_locations is None:
        raise ModuleNotFoundError(f"no package {name}", name=name)
    empty = ModuleSpec(name, None, is_package=True)
    empty.submodule_search_locations = found.submodule_search_locations
    return module_from_spec(empty)
