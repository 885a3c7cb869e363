"""Kernels are compiled once on a machine, and replaced by their twins where that fails."""

import os
import subprocess
import sys

import pytest

import roadeval
from roadeval.kernels import pick, plain, prepare
from tests.jobs.making import settings, write_log

PREPARE = "from roadeval.kernels import prepare; prepare(lambda: print('compiling'))"
PREPARE_ONE = """
from roadeval import kernels
from roadeval.kernels.bits import count_bits
from roadeval.kernels.compiler import compile_ahead
kernels.pick = lambda: compile_ahead(count_bits)
kernels.prepare(lambda: print("compiling"))
"""
"""One kernel for all: together they take ten seconds to compile."""


def python(code, **environment):
    """Run code in a process of its own; return what it prints."""
    run = [sys.executable, "-c", code]
    env = {**os.environ, **environment}
    return subprocess.run(run, capture_output=True, text=True, check=True, env=env).stdout


def test_the_first_process_compiles_and_says_so_and_the_next_one_loads(tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path)}
    assert python(PREPARE_ONE, **cache) == "compiling\n"
    assert python(PREPARE_ONE, **cache) == ""


def test_every_kernel_that_these_tests_have_compiled_is_loaded():
    assert python(PREPARE) == ""


def test_without_a_compiler_the_twins_are_used():
    none = "import sys; sys.modules['numba'] = None; "
    assert python(none + PREPARE + "; from roadeval.kernels import pick; print(pick())") == (
        f"{plain}\n"
    )


def test_a_run_without_compiled_kernels_compiles_nothing(monkeypatch):
    monkeypatch.setenv("ROADEVAL_PLAIN", "1")
    prepare(pytest.fail)


def test_loops_that_must_not_be_compiled_are_not(monkeypatch):
    monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
    assert pick() is plain


def test_a_user_mistake_is_reported_before_anything_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setattr("roadeval.jobs.run.load_kernels", pytest.fail)
    monkeypatch.setattr("roadeval.jobs.train.prepare", pytest.fail)
    drive, model = write_log(tmp_path / "drive.mcap"), tmp_path / "none.model"
    with pytest.raises(roadeval.RoadevalError, match=r"none\.model"):
        roadeval.replay(drive, settings(model=model), reports=tmp_path)
    with pytest.raises(roadeval.RoadevalError, match="nosuch"):
        roadeval.train([tmp_path / "nosuch.mcap"], model)


def test_replay_and_train_compile_before_all_else(tmp_path, monkeypatch):
    monkeypatch.setattr("roadeval.jobs.run.load_kernels", lambda on_compile: on_compile())
    monkeypatch.setattr("roadeval.jobs.train.prepare", lambda on_compile: on_compile())
    drive, stages = write_log(tmp_path / "drive.mcap"), []

    def seen():
        distinct = list(dict.fromkeys(stages))
        stages.clear()
        return distinct

    def note(step):
        stages.append(step.stage)

    folder = {"save": tmp_path / "out.rrd", "reports": tmp_path / "reports"}
    roadeval.replay(drive, **folder, on_progress=note)
    assert seen() == ["compiling", "training", "hashing", "replaying", "writing"]
    roadeval.train([drive], tmp_path / "x.model", on_progress=note)
    assert seen() == ["compiling", "training"]
    learnt = settings(model=tmp_path / "x.model", record="none")
    roadeval.replay(drive, learnt, **folder, on_progress=note)
    assert seen() == ["compiling", "hashing", "replaying", "writing"]
