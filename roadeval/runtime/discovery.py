"""What the modules of a folder define, so that one file adds one thing; and the code of modules."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any, Final

_IMPORTS: Final = re.compile(
    r"""(?:^|[;:])[ \t]*(?:from[ \t]+(\w+)|import[ \t]+([\w., \t]+))"""
    r"""|(?:import_module|__import__)\(\s*["'](\w+)""",
    re.MULTILINE,
)
"""An import in a source file. A line of a text that looks like one does no harm."""
_INSTALLED: Final = frozenset({"site-packages", "dist-packages"})
"""Folders of installed packages."""


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


@dataclass(frozen=True, slots=True)
class Code:
    """The code of some modules, to notice that it has changed."""

    modules: tuple[str, ...]
    digest: str
    """Of the files and the packages' versions, in hexadecimal; empty without a file."""
    files: tuple[str, ...]
    """The files that count, as ``mine/net/weights.npz``."""
    packages: Mapping[str, str] = field(hash=False)
    """Versions of the installed packages that these files import."""


def code_of(names: Iterable[str]) -> Code:
    """Return the code of modules as their files are now. None of them is imported.

    The top-level package of each module counts whole, data included; a module without a package
    counts as its file. What a counted file imports counts in the same way, but of an installed
    package only the version. Python's own modules and roadeval's do not count. Modules that are
    imported by a computed name are not seen.
    """
    from importlib.metadata import packages_distributions, version

    from roadeval.runtime.files import sha256_of

    roots = {name.partition(".")[0] for name in names}
    installed = packages_distributions() if roots else {}
    files: dict[str, Path] = {}
    packages: dict[str, str] = {}
    todo, seen = roots, {__name__.partition(".")[0], *sys.stdlib_module_names}
    while todo := todo - seen:
        seen |= todo
        for name in sorted(todo):
            places = _places(name)
            if name not in roots and any(_INSTALLED & {*place.parts} for place in places):
                packages |= {each: version(each) for each in installed.get(name, ())}
            else:
                files |= _files(name, places)
        todo = {name for path in files.values() for name in _imported(path)}
    parts = [f"{name} {sha256_of(files[name])}" for name in sorted(files)]
    parts += [f"{name}=={packages[name]}" for name in sorted(packages)]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest() if files else ""
    return Code(tuple(sorted(roots)), digest, tuple(sorted(files)), dict(sorted(packages.items())))


def _places(name: str) -> list[Path]:
    """Return the folders of a package, or the file of a module; none where there is neither."""
    try:
        spec = find_spec(name)
    except ValueError:  # a running program has made it
        return []
    if spec is None:
        return []
    file = [spec.origin] if spec.has_location and spec.origin else []
    return [Path(place) for place in spec.submodule_search_locations or file]


def _files(name: str, places: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Yield the files of a module or package, each with its name."""
    for place in places:
        if place.is_file():
            yield place.name, place
        for path in place.rglob("*"):
            below = path.relative_to(place)
            hidden = any(part[0] == "." or part == "__pycache__" for part in below.parts)
            if path.is_file() and not hidden:
                yield f"{name}/{below.as_posix()}", path


def _imported(path: Path) -> Iterator[str]:
    """Yield the names of the top-level modules that a source file may import."""
    for found in _IMPORTS.findall(path.read_text(errors="replace")) if path.suffix == ".py" else ():
        for name in "".join(found).split(","):
            yield from re.findall(r"\w+", name)[:1]
