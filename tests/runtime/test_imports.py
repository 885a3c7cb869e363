"""Names that are imported on demand."""

from importlib import import_module

import pytest

from roadeval.runtime.imports import _homes

PACKAGES = (
    "roadeval",
    *(f"roadeval.{room}" for room in ("config", "logs", "recording", "training")),
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_there_and_no_other(name):
    package = import_module(name)
    for each in _homes(name):
        assert getattr(package, each) is not None
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018
