"""Whole drives are replayed once; several tests look at each."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from roadeval.logs import LogWriter
from tests.e2e.commands import DEMO, Replayed, Run, replay, roadeval
from tests.training.making import frame


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """Do something in a folder, unless another worker of these tests has done it already."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def once(name: str, do: Callable[[Path], Run]) -> Replayed:
        folder, result = shared / name, shared / f"{name}.pickle"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not result.exists():
                folder.mkdir()
                result.write_bytes(pickle.dumps(do(folder)))
        return Replayed(pickle.loads(result.read_bytes()), folder)

    return once


@pytest.fixture(scope="session")
def demo(once) -> Replayed:
    """The synthetic drive that ships with the project."""
    return once("demo", lambda folder: replay(folder, DEMO).run)


@pytest.fixture(scope="session")
def at_home(once):
    """A replay of 20 frames without a word about outputs, and the folder it ran in."""
    words = ("--max-frames", 20, "--jobs", 2, "--json")
    done = once("home", lambda folder: roadeval("replay", DEMO, *words, cwd=folder))
    return done.run, done.folder


@pytest.fixture(scope="session")
def street(once, data) -> Replayed:
    """A street at 15 Hz whose truth is class ids: 3 is road, 11 is to be ignored."""
    drive = data / "drives" / "camvid_0016E5_15hz.mcap"
    labels = ("--road-label", 3, "--ignore-label", 11)
    return once("street", lambda folder: replay(folder, drive, *labels).run)


@pytest.fixture(scope="session")
def car_park(once, data) -> Replayed:
    """Streets and a car park at 1 Hz whose truth is a mask that needs no explanation."""
    drive = data / "drives" / "camvid_0006R0_1hz.mcap"
    return once("car_park", lambda folder: replay(folder, drive).run)


@pytest.fixture(scope="session")
def unlabelled(once, data) -> Replayed:
    """A city drive without truth."""
    drive = data / "drives" / "ford_shadows_unlabelled_raw.mcap"
    return once("unlabelled", lambda folder: replay(folder, drive).run)


@pytest.fixture(scope="session")
def ignored(once) -> Replayed:
    """A drive whose truth ignores every pixel once it has trained."""

    def do(folder: Path) -> Run:
        with LogWriter(folder / "drive.mcap") as log:
            for number in range(16):
                made, stamp = frame(number), (number + 1) * 100_000_000
                _, png = cv2.imencode(".png", made.image[..., ::-1])
                log.image("/camera/image", stamp, png.tobytes(), "png")
                log.mask("/truth/road", stamp, made.truth if number < 12 else made.truth * 0 + 11)
        words = ("--road-label", 1, "--ignore-label", 11, "--train-frames", 12)
        return replay(folder, folder / "drive.mcap", *words).run

    return once("ignored", do)
