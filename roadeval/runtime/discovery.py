"""What the modules of a folder define, so that one file adds one thing."""

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


def found_in(package: ModuleType, name: str) -> tuple[Any, ...]:
    """Return what the modules of a package call ``name``, in the order of the modules' names.

    Modules without the name, and those whose own name begins with ``_``, are left out.
    """
    names = sorted(module.name for module in iter_modules(package.__path__))
    modules = [import_module(f"{package.__name__}.{each}") for each in names if each[0] != "_"]
    return tuple(getattr(module, name) for module in modules if hasattr(module, name))
