"""How long the tests of this folder look."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--fuzz-seconds",
        type=float,
        default=0,
        help="Try cases for so long with each harness, in place of the few of the test command.",
    )
