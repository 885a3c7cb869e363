"""Whole drives are replayed once; several tests look at each."""

from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.commands import CLASSES, DEMO, Replayed, Run, here, replay, roadeval
from tests.e2e.test_fleet import Here
from tests.fixtures.browser import browser, watched  # noqa: F401
from tests.fixtures.make import make


@pytest.fixture
def without_workers(monkeypatch):
    """Let ``fleet`` do its tasks in this process: Dask's workers take seconds to begin."""

    @contextmanager
    def start_workers(*_):
        yield Here(), 1

    monkeypatch.setattr("roadeval.jobs.run.fleet.start_workers", start_workers)


@pytest.fixture(scope="session")
def demo(once) -> Replayed:
    """The synthetic drive that ships with the project, replayed by the installed program."""
    return Replayed(*once("demo", lambda folder: replay(folder, DEMO, run=roadeval).run))


@pytest.fixture(scope="session")
def at_home(once):
    """A replay by two workers without a word about outputs, and the folder it ran in."""

    def do(folder: Path) -> Run:
        drive = make("drives/street.mcap", folder)
        return here("replay", drive, *CLASSES, "--jobs", 2, "--json", cwd=folder)

    return once("home", do)


def of_drive(name: str, *words: Any) -> Callable[[Path], Run]:
    """Return what replays one of the small drives."""

    def do(folder: Path) -> Run:
        return replay(folder, make(f"drives/{name}.mcap", folder), *words).run

    return do


@pytest.fixture(scope="session")
def street(once) -> Replayed:
    """A street whose truth is class ids: 3 is road, 11 is to be ignored."""
    return Replayed(*once("street", of_drive("street", *CLASSES)))


@pytest.fixture(scope="session")
def car_park(once) -> Replayed:
    """A drive whose truth is a mask that needs no explanation."""
    return Replayed(*once("car_park", of_drive("car_park")))


@pytest.fixture(scope="session")
def unlabelled(once) -> Replayed:
    """A drive without truth."""
    return Replayed(*once("unlabelled", of_drive("unlabelled")))


@pytest.fixture(scope="session")
def sparse(once) -> Replayed:
    """A replay that keeps the pictures of every seventh frame."""
    return Replayed(*once("sparse", of_drive("street", *CLASSES, "--record", "every:7")))
