"""What every room's tests share: compiled kernels, and examples without a deadline."""

import pytest
from hypothesis import settings

from roadeval.kernels import prepare

# A compiled kernel takes seconds where it is compiled: no deadline for a single example.
settings.register_profile("roadeval", deadline=None)
settings.load_profile("roadeval")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--write-golden",
        action="store_true",
        help="Write the golden files anew instead of comparing with them.",
    )


def pytest_sessionstart() -> None:
    """Have everything compiled before several processes want to at once."""
    prepare(lambda: None)
