"""What every room's tests share: examples without a deadline, and the loops that are there."""

import os
from importlib.util import find_spec

import pytest
from hypothesis import settings

# The machine may be busy with something else.
settings.register_profile("roadeval", deadline=None)
settings.load_profile("roadeval")

# Installed without a C compiler: the twins are used as if somebody had asked for them, for who did
# not is told so by every run, and what the runs tell is compared word for word. The tests of the
# loops themselves are skipped.
if find_spec("roadeval.kernels._loops") is None:
    os.environ["ROADEVAL_PLAIN"] = "1"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--write-golden",
        action="store_true",
        help="Write the golden files anew instead of comparing with them.",
    )
