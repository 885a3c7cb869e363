"""Public names that are imported when they are first used."""

import subprocess
import sys
from importlib import import_module

import pytest

PACKAGES = (
    "roadeval",
    *(f"roadeval.{room}" for room in ("config", "logs", "recording", "training")),
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_there_and_no_other(name):
    package = import_module(name)
    for each in package.__all__:
        assert getattr(package, each) is not None
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_by_itself_imports_no_library(name):
    code = f"import sys, {name}; print({{'numpy', 'pydantic', 'rerun'}} & {{*sys.modules}} or '')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.strip()


def test_results_are_compared_without_rerun_and_without_matplotlib():
    code = (
        "import sys, roadeval.jobs.compare; print({'rerun', 'matplotlib'} & {*sys.modules} or '')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.strip()
