"""The compiled kernels are there, and replaced by their twins where they are not."""

import sys
from importlib.util import find_spec

import pytest

from roadeval import kernels
from roadeval.cli.app import main
from roadeval.kernels import pick, plain
from tests.jobs.making import write_log


@pytest.fixture
def unbuilt(monkeypatch):
    """As if no compiler had been there when the package was installed."""
    monkeypatch.delenv("ROADEVAL_PLAIN", raising=False)
    monkeypatch.delitem(sys.modules, "roadeval.kernels.compiled", raising=False)
    monkeypatch.delattr(kernels, "compiled", raising=False)
    monkeypatch.delattr(kernels, "_loops", raising=False)
    monkeypatch.setitem(sys.modules, "roadeval.kernels._loops", None)
    chosen = vars(kernels.KERNELS)
    before = dict(chosen)
    chosen.clear()
    yield
    chosen.clear()
    chosen.update(before)


@pytest.mark.skipif(not find_spec("roadeval.kernels._loops"), reason="the loops were not compiled")
def test_a_library_that_was_built_is_used_unless_the_twins_are_asked_for(monkeypatch):
    monkeypatch.delenv("ROADEVAL_PLAIN", raising=False)
    assert pick().__name__ == "roadeval.kernels.compiled"
    assert not kernels.missing()
    monkeypatch.setenv("ROADEVAL_PLAIN", "1")
    assert pick() is plain


def test_without_the_library_the_twins_are_used(unbuilt):
    assert pick() is plain
    assert kernels.missing()


def test_a_run_without_the_library_says_what_it_costs(unbuilt, tmp_path, capsys):
    drive = write_log(tmp_path / "drive.mcap")
    outputs = ["--record", "none", "--reports", str(tmp_path / "reports")]
    main(["replay", str(drive), *outputs])
    assert "roadeval: warning: the compiled loops are missing" in capsys.readouterr().err
    main(["train", str(drive), "-o", str(tmp_path / "x.model")])
    assert "roadeval: warning: the compiled loops are missing" in capsys.readouterr().err
