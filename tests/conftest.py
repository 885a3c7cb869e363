"""What every room's tests share: where the test data lies."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from roadeval.kernels import prepare

# A compiled kernel takes seconds where it is compiled: no deadline for a single example.
settings.register_profile("roadeval", deadline=None)
settings.load_profile("roadeval")

ROOT = Path(__file__).resolve().parents[1]


def pytest_sessionstart() -> None:
    """Have everything compiled before several processes want to at once."""
    prepare(lambda: None)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real drives and logs; skips where it is missing, unless it is required."""
    folder = Path(os.environ.get("ROADEVAL_DATA", ROOT.parent / "shared" / "data"))
    if folder.is_dir():
        return folder
    if os.environ.get("ROADEVAL_REQUIRE_DATA") == "1":
        pytest.fail(f"ROADEVAL_REQUIRE_DATA=1, but there is no test data in {folder}")
    pytest.skip("no test data: set ROADEVAL_DATA to the folder of real drives")
