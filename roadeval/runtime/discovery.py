"""Definitions collected from the modules of a folder, so that one file adds one thing."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any


def by_name(things: Iterable[Any]) -> dict[str, Any]:
    """Return things by their ``name``, in their order; a ValueError if two have the same."""
    named: dict[str, Any] = {}
    for thing in things:
        if named.setdefault(thing.name, thing) is not thing:
            raise ValueError(f"two files define {thing.name!r}: {thing} and {named[thing.name]}")
    return named


def collect(package: ModuleType, name: str) -> tuple[Any, ...]:
    """Return the objects called ``name`` in the modules of a package, sorted by module.

    Modules without such an object, or with a name that begins with ``_``, are left out.
    """
    names = sorted(module.name for module in iter_modules(package.__path__))
    modules = [import_module(f"{package.__name__}.{file}") for file in names if file[0] != "_"]
    return tuple(getattr(module, name) for module in modules if hasattr(module, name))
