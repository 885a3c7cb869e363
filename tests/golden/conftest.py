"""The tiny drive is run through the commands once; every test here reads what they left."""

from pathlib import Path

import pytest

from tests.golden import commands


@pytest.fixture(scope="session")
def told(once) -> commands.Told:
    """What the commands printed and wrote."""
    return commands.Told(*once("golden", commands.run_all))


@pytest.fixture(scope="session")
def expected() -> Path:
    return Path(__file__).parent / "expected"
