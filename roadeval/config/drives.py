"""Settings of single drives, where they differ from the run's."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from roadeval.config.errors import ConfigError
from roadeval.config.variants import check_tables
from roadeval.runtime.text import public_url

OF_A_LOG: Final = ("topics", "labels", "frames", "masks")
"""The tables that may differ from drive to drive."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """What is asked of some drives in place of what is asked of all."""

    path: str
    """Of the drives: a path, or the end of one, as a file's name; ``*`` and ``?`` stand for any
    text within a name."""
    tables: Mapping[str, Mapping[str, Any]]
    """``topics``, ``labels``, ``frames`` and ``masks`` in the shape of a TOML file. Labels take the
    place of the run's as a whole, the others key by key."""
    where: str = field(default="", compare=False)
    """Begins a message about them."""

    @classmethod
    def of(cls, tables: Mapping[str, Any], where: str) -> DriveSettings:
        """Make the settings from an entry of ``[[drives]]``; `RunConfig` validates its tables.

        Raises
        ------
        ConfigError
            If the entry has no path, or a table that holds for the whole run.
        """
        path = tables.get("path")
        if not isinstance(path, str) or not path or "\0" in path:
            raise ConfigError(f"{where}: path must name a log, or several as *.mcap")
        rest = {key: value for key, value in tables.items() if key != "path"}
        path = public_url(path)
        check_tables(rest, OF_A_LOG, f"{where} {path}")
        return cls(path, rest, f"{where} {path}")

    def holds_for(self, drive: str | os.PathLike[str]) -> bool:
        """Whether a drive is one of these."""
        wanted, typed = public_url(self.path), Path(public_url(os.fspath(drive)))
        real = typed.resolve()
        return real == Path(wanted).resolve() or typed.match(wanted) or real.match(wanted)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of ``[[drives]]``."""
        return {"path": self.path, **self.tables}


def drives_of(entries: Any, where: str) -> Iterable[DriveSettings]:
    """Read the entries of ``[[drives]]``; a `ConfigError` for what cannot be used."""
    begin = f"{where}: " if where else ""
    if not isinstance(entries, list | tuple) or not all(isinstance(e, Mapping) for e in entries):
        raise ConfigError(f"{begin}drives must be tables, each under [[drives]]")
    return [DriveSettings.of(entry, f"{begin}[[drives]]") for entry in entries]
