"""A log by its name: one made here, or a shared one."""

from pathlib import Path

import pytest

from tests.fixtures.make import make
from tests.fixtures.shared import SHARED


@pytest.fixture
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return the path of the log that a case of `tests.fixtures.shared.both` names."""
    origin, _, name = request.param.partition(":")
    if origin == "shared" and SHARED:
        return SHARED / "mcap" / name
    try:
        return make(name, tmp_path)
    except LookupError as missing:
        pytest.skip(str(missing))
