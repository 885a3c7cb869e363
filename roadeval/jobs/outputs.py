"""The files and folders that a command writes, claimed before it computes anything."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from roadeval.errors import RoadevalError
from roadeval.recording.layout import RecordRule
from roadeval.results.facts import SUMMARY, is_fleet
from roadeval.results.fleet import FILES
from roadeval.results.folder import CONTENT, names_of_results
from roadeval.runtime.files import (
    AnyPath,
    claim_file,
    claim_folder,
    find_partial,
    remove,
    target_of,
)

if TYPE_CHECKING:
    from roadeval.config.settings import OutputSettings


@dataclass(frozen=True)
class Outputs:
    """The files and folders of a run."""

    recording: Path | None
    """It is None if nothing is recorded."""
    reports: Path
    """The folder of tables and figures."""
    mcap: Path | None
    """The log of masks, if it is written."""

    @classmethod
    def of(cls, settings: OutputSettings, drive: str) -> Outputs:
        """Return the places of a drive's results: from the settings, or by its name.

        If the settings name only the recording, the folder has its name, so that the folder of
        another run is not replaced.
        """
        saved = Path(settings.save or Path("recordings", f"{drive}.rrd"))
        name = (saved.stem if settings.save else drive).strip(".") or drive
        return cls(
            saved if RecordRule.parse(settings.record).recorded else None,
            Path(settings.reports or Path("reports", name)),
            Path(settings.mcap) if settings.mcap else None,
        )

    @contextmanager
    def holding(self, inputs: Iterable[AnyPath | None]) -> Iterator[None]:
        """Hold them all, as `holding` does; at the end remove earlier partial recordings."""
        with holding(self.recording, self.mcap, folder=self.reports, inputs=inputs) as certain:
            ours = certain and self.recording
            there = find_partial(target_of(ours), hidden=False) if ours else []
            yield
            for partial in there:
                remove(partial)


@contextmanager
def holding(
    *files: AnyPath | None, folder: Path | None = None, inputs: Iterable[AnyPath | None] = ()
) -> Iterator[bool]:
    """Hold the files that a command writes, and its results folder, if it writes one.

    Leftovers of earlier runs are removed. Yields whether it is certain that no other run writes
    them. A `RoadevalError` if one is an input or another output, cannot be written, or is being
    written by another run.
    """
    paths = [Path(file) for file in files if file is not None]
    outputs = [*paths, *([folder] if folder else [])]
    # For a loop of links pathlib raises an error of its own.
    places = [os.path.realpath(path) for path in outputs]
    taken = set[str]()
    for path in (Path(file) for file in inputs if file):
        names: Iterable[str] = FILES if is_fleet(path) else ()
        if not names and (path / SUMMARY).is_file():
            names = names_of_results(path / SUMMARY)
        taken |= {os.path.realpath(file) for file in (path, *(path / name for name in names))}
    for number, path in enumerate(outputs):
        earlier = places[:number] if path is folder else {*places[:number], *taken}
        if places[number] in earlier:
            raise RoadevalError(
                "is an input or another output", where=path, remedy="name a file of its own"
            )
    with ExitStack() as claims:
        certain = [_claim(claims, path, claim_file(path)) for path in paths]
        if folder:
            certain.append(_claim(claims, folder, claim_folder(folder, CONTENT)))
        yield all(certain)


def _claim(claims: ExitStack, path: Path, claim: AbstractContextManager[bool]) -> bool:
    try:
        return claims.enter_context(claim)
    except BlockingIOError as error:
        raise RoadevalError(
            str(error.strerror), where=path, remedy="wait until it has ended, or write elsewhere"
        ) from error
    except OSError as error:
        raise RoadevalError(f"cannot be written: {error.strerror}", where=path) from error
