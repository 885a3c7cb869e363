"""Every example in a docstring runs, and shows what it says."""

import doctest
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import pytest

import roadeval
from tests.golden import drive

HOME = Path(roadeval.__file__).parent
SOURCES = {path: path.read_text() for path in sorted(HOME.rglob("*.py"))}
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def name_of(path: Path) -> str:
    parts = path.relative_to(HOME.parent).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = [name_of(path) for path, text in SOURCES.items() if ">>> " in text]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """What examples speak of: a drive, its recording, a model, and a fleet of that drive."""
    folder = tmp_path_factory.mktemp("examples")
    drive.write(folder / "drive.mcap", frames=14)
    reports = folder / "reports"
    roadeval.replay(folder / "drive.mcap", save=folder / "out.rrd", reports=reports)
    roadeval.train([folder / "drive.mcap"], folder / "city.model")
    with ThreadPoolExecutor(1) as pool:
        roadeval.replay_fleet([folder / "drive.mcap"], folder / "monday", executor=pool)
    return folder


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_run(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    found = doctest.testmod(import_module(name), optionflags=OPTIONS)
    assert found.attempted
    assert not found.failed


def test_no_example_is_skipped():
    assert not [name_of(path) for path, text in SOURCES.items() if "doctest: +SKIP" in text]
