"""Modules found by the folder in which they lie, so that adding one file adds one thing."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any


def found_in(package: ModuleType, name: str) -> tuple[Any, ...]:
    """Return what the modules of a package call ``name``, in the order of the modules' names.

    Modules without the name, and those whose own name begins with ``_``, are passed over.

    Parameters
    ----------
    package
        An imported package.
    name
        As ``STAGE``.

    Raises
    ------
    Exception
        Whatever a module raises when it is imported.
    """
    names = sorted(module.name for module in iter_modules(package.__path__))
    modules = [import_module(f"{package.__name__}.{each}") for each in names if each[0] != "_"]
    return tuple(getattr(module, name) for module in modules if hasattr(module, name))
