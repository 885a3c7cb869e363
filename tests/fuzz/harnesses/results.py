"""Recordings and results folders: whatever the bytes, what can be read is read, or one line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

from roadeval import Recording, RoadevalError, load_config
from roadeval.jobs.results.report import collect
from roadeval.jobs.results.result import DriveResult
from roadeval.report import figures
from roadeval.report.document import document
from roadeval.results.folder import RUN
from tests.compatibility.make import RECORDING, RESULTS, make
from tests.fuzz.harness import Harness, scratch


def check(data: bytes) -> None:
    """Let these be the bytes of the file that the first one chooses; read the results."""
    file = files()[data[0] % len(files())] if data else files()[0]
    sound = file.read_bytes()
    file.write_bytes(data[1:])
    try:
        read(DriveResult(file if file.name == RECORDING else file.parent))
    finally:
        file.write_bytes(sound)


def read(result: DriveResult) -> None:
    """Read all that a result holds: what a report needs, its configuration, its pictures."""
    readers: list[Callable[[], Any]] = [
        lambda: result.table("regions"),
        lambda: document(collect(result)),
        lambda: load_config(result.path if result.recording else result.path / RUN),
    ]
    if result.recording is not None:
        readers += pictures(result.recording)
    for reader in readers:
        with suppress(RoadevalError):
            reader()


def pictures(recording: Recording) -> Iterator[Callable[[], Any]]:
    """Yield what returns a picture or a number of the first frames."""
    yield lambda: recording.scalars("/timing/filtered/post")
    for frame in recording.frame_numbers[:2]:
        for whole in (recording.image, recording.truth, recording.notes):
            yield lambda whole=whole, frame=frame: whole(frame)
        for variant in recording.variants:
            for spec in variant.layers:
                words = (variant.name, spec.name, frame)
                yield lambda words=words: recording.layer(*words)


@cache
def files() -> list[Path]:
    """Return the files of a drive's results."""
    folder = scratch() / "results"
    with mock.patch.object(figures, "write_figures", return_value=[]):
        make(folder)
    return [folder / RECORDING, *sorted((folder / RESULTS).iterdir())]


def seeds() -> list[bytes]:
    """Return every file, and the part of a recording that a killed run leaves."""
    found = [bytes([number]) + path.read_bytes() for number, path in enumerate(files())]
    return [*found, found[0][: len(found[0]) * 3 // 4]]


HARNESS = Harness(check, seeds, quick=5)
