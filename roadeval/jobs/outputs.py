"""The files and folders that a command writes: it holds them before it computes anything."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from roadeval.errors import RoadevalError
from roadeval.recording import RecordRule
from roadeval.results.fleet.kind import FILES, is_fleet
from roadeval.results.folder import CONTENT, belonging
from roadeval.results.summary import SUMMARY
from roadeval.runtime.claims import claimed
from roadeval.runtime.files import check_file, check_folder, made, own_names, target_of
from roadeval.runtime.folders import home_of, recover
from roadeval.runtime.paths import AnyPath

if TYPE_CHECKING:
    from roadeval.config import OutputSettings


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files and folders of a run."""

    recording: Path | None
    """None where nothing is recorded."""
    reports: Path
    """The folder of tables and figures."""
    mcap: Path | None
    """The log of masks; None where nobody asked for it."""

    @classmethod
    def of(cls, settings: OutputSettings, drive: str) -> Outputs:
        """Return where a drive's results land: where the settings say, or under its name."""
        saved = Path(settings.save or Path("recordings", f"{drive}.rrd"))
        return cls(
            saved if RecordRule.parse(settings.record).recorded else None,
            Path(settings.reports or Path("reports", drive)),
            Path(settings.mcap) if settings.mcap else None,
        )

    @contextmanager
    def holding(self, inputs: Iterable[AnyPath | None]) -> Iterator[Path | None]:
        """Hold them all; yield the newest partial recording that an earlier run has left.

        Whatever else earlier runs have left of these outputs is removed.

        Raises
        ------
        RoadevalError
            If one is an input or another output, cannot be written, or is being written by
            another run.
        """
        _keep_apart(inputs, (self.recording, self.mcap))
        _keep_apart((), (self.recording, self.mcap, self.reports))
        with ExitStack() as claims:
            _claim_file(claims, self.mcap)
            left = _claim_recording(claims, self.recording)
            _claim_folder(claims, self.reports)
            yield left


@contextmanager
def holding(*files: AnyPath, inputs: Iterable[AnyPath | None] = ()) -> Iterator[None]:
    """Hold the files that a command writes; what earlier runs have left of them is removed.

    Raises
    ------
    RoadevalError
        If one is an input or another output, cannot be written, or is being written by another
        run.
    """
    _keep_apart(inputs, files)
    with ExitStack() as claims:
        for file in files:
            _claim_file(claims, Path(file))
        yield


def _keep_apart(inputs: Iterable[AnyPath | None], outputs: Iterable[AnyPath | None]) -> None:
    """Refuse an output that would replace an input or another output."""
    # Of a loop of links pathlib makes an error of its own.
    taken = {Path(os.path.realpath(path)) for path in inputs if path is not None}
    taken |= {path / name for path in taken for name in _content(path)}
    for path in outputs:
        if path is None:
            continue
        place = Path(os.path.realpath(path))
        if place in taken:
            raise RoadevalError(f"{path}: is an input or another output; name a file of its own")
        taken.add(place)


def _content(folder: Path) -> Iterable[str]:
    """Return the names of the files by which a folder is a result or a fleet."""
    if is_fleet(folder):
        return FILES
    return belonging(folder) if (folder / SUMMARY).is_file() else ()


def _claim_file(claims: ExitStack, path: Path | None) -> bool:
    """Claim a file; return whether it is certain that no other run writes it."""
    if path is None:
        return False
    with _explained(path):
        check_file(path)
        target = target_of(path)
        claims.enter_context(made(target.parent))
        certain = claims.enter_context(claimed(target, target.parent))
        if certain:
            _remove(own_names(target))
    return certain


def _claim_recording(claims: ExitStack, path: Path | None) -> Path | None:
    """Claim a recording; return the newest partial one, which may be all that a run has left."""
    if path is None or not _claim_file(claims, path):
        return None
    with _explained(path):
        left = own_names(target_of(path), hidden=False)
        newest = [each for each in left if each.is_file() and each.stat().st_size][-1:]
    _remove(each for each in left if each not in newest)
    return next(iter(newest), None)


def _claim_folder(claims: ExitStack, path: Path) -> None:
    with _explained(path):
        check_folder(path)
        target = Path(os.path.realpath(path))
        home = home_of(target)
        claims.enter_context(made(home))
        if claims.enter_context(claimed(target, home)):
            recover(target, CONTENT)


def _remove(paths: Iterable[Path]) -> None:
    """Remove files and folders; what cannot be removed is only clutter."""
    for path in paths:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except BlockingIOError as error:
        raise RoadevalError(
            f"{path}: {error.strerror}; wait until it has ended, or write elsewhere"
        ) from error
    except OSError as error:
        raise RoadevalError(f"{path}: cannot be written: {error.strerror}") from error
