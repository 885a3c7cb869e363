"""What is compiled ahead is all that a run needs, and is compiled once."""

import subprocess
import sys
from collections import Counter
from signal import SIGKILL
from subprocess import Popen

import pytest

import roadeval
from roadeval.kernels import compiled, first_time, pick, plain
from roadeval.kernels.first_time import call_all, prepare
from roadeval.runtime import processes as apart
from tests.e2e.commands import DEMO
from tests.jobs.making import settings, write_log


class Calls(Counter):
    """Stands for the kernels and counts how often each is called."""

    def __getattr__(self, name):
        return lambda *given: self.update([name])


def test_every_kernel_is_called_once():
    calls = Calls()
    call_all(calls)
    assert calls == Counter(compiled.__all__)


def test_the_process_that_compiles_calls_them():
    program = """
import runpy

from roadeval.kernels import compiled

runpy.run_module("roadeval.kernels.first_time", run_name="__main__")
assert all(getattr(compiled, name).signatures for name in compiled.__all__)
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_run_of_any_preset_needs_nothing_else():
    program = f"""
import sys
import tempfile

import arch.bootstrap, sklearn.svm
import roadeval, roadeval.jobs.replay
from roadeval.config import PRESETS
from tests.jobs.making import settings
from roadeval.kernels import compiled, first_time

sys.modules["roadeval.jobs.replay"].write_figures = lambda *given: []


def kinds():
    return {{name: getattr(compiled, name).signatures for name in compiled.__all__}}


first_time.call_all(compiled)
ahead = kinds()
for name in PRESETS:
    with tempfile.TemporaryDirectory() as folder:
        config = settings(preset=name, max_frames=14, train_frames=4, scale=0.25, record="none")
        roadeval.replay({str(DEMO)!r}, config, reports=folder)
assert kinds() == ahead, [name for name, made in kinds().items() if made != ahead[name]]
"""
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.fixture
def unmarked(tmp_path, monkeypatch):
    """A machine where nothing is known to be compiled; gives what is started there."""
    started = []

    def start(module):
        started.append(module)
        return Popen("true")

    monkeypatch.setattr(first_time, "_mark", lambda kernels: tmp_path / "mark")
    monkeypatch.setattr(apart, "start", start)
    return started


def test_it_is_done_once_and_whoever_waits_is_told(unmarked):
    told = []
    for _ in range(2):
        prepare(lambda: told.append(list(unmarked)))
    assert told == [[]]
    assert unmarked == ["roadeval.kernels.first_time"]


def test_replay_and_train_compile_before_all_else(unmarked, tmp_path):
    drive, stages = write_log(tmp_path / "drive.mcap"), []
    folder = {"save": tmp_path / "out.rrd", "reports": tmp_path / "reports"}
    roadeval.replay(drive, **folder, on_progress=lambda step: stages.append(step.stage))
    assert list(dict.fromkeys(stages)) == ["compiling", "training", "replaying", "writing"]
    (tmp_path / "mark").unlink()
    stages.clear()
    roadeval.train([drive], tmp_path / "x.model", on_progress=lambda s: stages.append(s.stage))
    assert list(dict.fromkeys(stages)) == ["compiling", "training"]
    (tmp_path / "mark").unlink()
    stages.clear()
    learnt = settings(model=tmp_path / "x.model", record="none")
    roadeval.replay(drive, learnt, **folder, on_progress=lambda s: stages.append(s.stage))
    assert list(dict.fromkeys(stages)) == ["compiling", "replaying", "writing"]
    assert len(unmarked) == 3


def test_a_run_without_compiled_kernels_compiles_nothing(unmarked, monkeypatch):
    monkeypatch.setenv("ROADEVAL_PLAIN", "1")
    prepare(pytest.fail)
    assert not unmarked


@pytest.mark.parametrize("error", [KeyboardInterrupt, TimeoutError])
def test_an_interruption_ends_what_was_started_and_it_is_done_again(unmarked, monkeypatch, error):
    process = Popen(["sleep", "100"])

    def interrupted():
        raise error

    with monkeypatch.context() as patched:
        patched.setattr(process, "communicate", interrupted)
        patched.setattr(apart, "start", lambda module: process)
        with pytest.raises(error):
            prepare(lambda: None)
    assert process.returncode == -SIGKILL
    prepare(lambda: None)
    assert len(unmarked) == 1


def test_what_somebody_ended_is_done_again(unmarked, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(apart, "start", lambda module: Popen(["sh", "-c", "kill -9 $$"]))
        prepare(lambda: None)
    prepare(lambda: None)
    assert len(unmarked) == 1


def test_what_fails_is_not_tried_again(unmarked, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(apart, "start", lambda module: Popen("false"))
        prepare(lambda: None)
    prepare(lambda: None)
    assert not unmarked


def test_a_machine_that_starts_no_process_is_asked_again(unmarked, monkeypatch):
    def no_process(module):
        raise PermissionError

    with monkeypatch.context() as patched:
        patched.setattr(apart, "start", no_process)
        prepare(lambda: None)
    prepare(lambda: None)
    assert len(unmarked) == 1


@pytest.mark.parametrize(
    ("where", "what"),
    [
        ("numba.__version__", "0.0"),
        ("sys.version", "2.7"),
        ("llvmlite.binding.get_host_cpu_name", lambda: "6502"),
    ],
)
def test_the_mark_is_another_for_other_versions_and_processors(monkeypatch, where, what):
    before = first_time._mark(compiled)
    monkeypatch.setattr(where, what)
    assert first_time._mark(compiled) != before


def test_a_mistake_is_told_before_anything_is_compiled(unmarked, tmp_path):
    drive, model = write_log(tmp_path / "drive.mcap"), tmp_path / "none.model"
    folder = {"save": tmp_path / "out.rrd", "reports": tmp_path / "reports"}
    with pytest.raises(roadeval.RoadevalError, match=r"none\.model"):
        roadeval.replay(drive, settings(model=model), **folder)
    with pytest.raises(roadeval.RoadevalError, match="nosuch"):
        roadeval.train([tmp_path / "nosuch.mcap"], model)
    assert not unmarked


def test_loops_that_must_not_be_compiled_are_not(monkeypatch):
    monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
    assert pick() is plain


def test_other_sources_are_compiled_anew(tmp_path, monkeypatch):
    source = tmp_path / "kernel.py"
    source.write_text("1")
    monkeypatch.setattr(first_time, "__file__", str(tmp_path / "first_time.py"))
    before = first_time._mark(compiled)
    assert first_time._mark(compiled) == before
    source.write_text("12")
    assert first_time._mark(compiled) != before
