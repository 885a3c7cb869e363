"""Definitions collected from the modules of a folder, and from other installed packages.

One file of a folder adds one thing. A package adds the same by an entry point of the group
``roadeval.KIND``, which leads to one thing of that kind or to a list of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, EntryPoints, PackageNotFoundError, entry_points, version
from pkgutil import iter_modules
from traceback import walk_tb
from types import ModuleType
from typing import Any, Final, TypeVar

from roadeval.runtime.text import visible

KINDS: Final = ("disturbances", "label_formats", "metrics", "regions", "stages")
"""The kinds of things that other packages may add."""
Thing = TypeVar("Thing")


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


_all_points = cache(entry_points)
"""All entry points, looked up once: it takes long to search all installed packages."""


@cache
def points_of(kind: str) -> EntryPoints:
    """Return the entry points by which installed packages add things of a kind."""
    return _all_points().select(group=f"roadeval.{kind}")


def installed(
    kind: str, expected: type[Thing], error: Callable[..., Exception], taken: Iterable[str] = ()
) -> list[Thing]:
    """Return what other installed packages add to a kind, sorted by the entry points' names.

    An ``error`` names the package if it cannot be imported, adds something else, or something
    under a name that is ``taken``.
    """
    names, things = {*taken}, list[Thing]()
    for point in sorted(points_of(kind), key=lambda point: point.name):
        try:
            loaded = point.load()
            several = isinstance(loaded, list | tuple) and not isinstance(loaded, expected)
            for thing in loaded if several else [loaded]:
                if not isinstance(thing, expected):
                    raise TypeError(f"{point.value} is not a {expected.__name__}")
                if (name := str(getattr(thing, "name", ""))) in names:
                    raise ValueError(f"the name {name!r} is taken")
                names |= {name} - {""}
                things.append(thing)
        except (Exception, SystemExit) as problem:  # code from outside may raise anything
            what = f"cannot be used for {kind}: {one_line(problem)}"
            raise error(what, where=f"the package {package_of(point)}") from problem
    return things


def package_of(point: EntryPoint) -> str:
    """Return the name of the package that an entry point belongs to."""
    return visible(point.dist.name if point.dist else point.module)


def versions_of_additions() -> dict[str, str]:
    """Return the versions of the packages with additions that take part in every run."""
    points = (point for kind in KINDS if kind != "stages" for point in points_of(kind))
    return {package_of(point): point.dist.version for point in points if point.dist}


def versions_of(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of packages, as far as they are installed."""
    versions = {}
    for package in packages:
        with suppress(PackageNotFoundError):
            versions[package] = version(package)
    return versions


def failed_package(error: BaseException) -> str:
    """Return the name of the added package in which an error arose; empty if there is none."""
    modules = {frame.f_globals.get("__name__") for frame, _ in walk_tb(error.__traceback__)}
    points = (point for kind in KINDS for point in points_of(kind))
    return next((package_of(point) for point in points if point.module in modules), "")


def one_line(error: BaseException) -> str:
    """Return the kind and the message of an error from outside."""
    return visible(" ".join(f"{type(error).__name__}: {error}".split()))
