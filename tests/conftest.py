"""What every room's tests share: examples without a deadline."""

import pytest
from hypothesis import settings

# The machine may be busy with something else.
settings.register_profile("roadeval", deadline=None)
settings.load_profile("roadeval")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--write-golden",
        action="store_true",
        help="Write the golden files anew instead of comparing with them.",
    )
