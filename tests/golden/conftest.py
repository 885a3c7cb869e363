"""The tiny drive is run through the commands once; every test here reads what they left."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from tests.golden import commands


@pytest.fixture(scope="session")
def told(tmp_path_factory) -> commands.Told:
    """What the commands printed and wrote; by one worker for all."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = shared / "golden"
    with (shared / "golden.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / commands.DONE).exists():
            folder.mkdir(exist_ok=True)
            commands.run_all(folder)
    return commands.Told(folder)


@pytest.fixture(scope="session")
def expected() -> Path:
    return Path(__file__).parent / "expected"
