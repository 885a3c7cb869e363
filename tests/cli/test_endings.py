"""However a command ends: one line on stderr, no traceback, and the exit code for it."""

import errno
import os
import signal
import subprocess
import sys

import pytest
import typer

from roadeval.cli.app import explain, main
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.signals import Stopped


def lines(capsys):
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize(
    ("code", "name"), [(ExitCode.INTERRUPTED, "SIGINT"), (ExitCode.TERMINATED, "SIGTERM")]
)
def test_a_signal_has_its_own_exit_code_and_tells_what_is_left(code, name, capsys):
    error = Stopped(code)
    error.add_note("the partial recording is out.partial.rrd")
    assert explain(error) == 128 + getattr(signal, name)
    assert lines(capsys) == [
        "roadeval: interrupted: stopped before the end; the partial recording is out.partial.rrd"
    ]


def test_wrong_usage_points_to_the_help(capsys):
    assert explain(typer.BadParameter("'x' is no number.")) == 2
    assert lines(capsys) == ["roadeval: error: 'x' is no number"]
    assert main(["replay", "--no-such-option"]) == 2
    assert lines(capsys) == [
        "roadeval: error: No such option: --no-such-option; see 'roadeval replay --help'"
    ]


def test_an_error_of_the_system_is_a_known_problem(capsys):
    error = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out.rrd")
    assert explain(error) == 1
    assert lines(capsys) == ["roadeval: error: No space left on device: out.rrd"]


def test_a_defect_keeps_its_traceback_to_itself_but_says_how_to_see_it(capsys):
    assert explain(KeyError("ndi")) == 70
    (line,) = lines(capsys)
    assert line.startswith("roadeval: error: KeyError: 'ndi' (a defect of roadeval")
    assert "ROADEVAL_DEBUG=1" in line


def test_the_traceback_is_there_for_who_asks(capsys, monkeypatch):
    monkeypatch.setenv("ROADEVAL_DEBUG", "1")
    try:
        raise KeyError("ndi")
    except KeyError as error:
        explain(error)
    assert lines(capsys)[0] == "Traceback (most recent call last):"


@pytest.mark.parametrize("length", [1, 1_000_000], ids=["buffered", "written"])
def test_a_reader_of_stdout_who_has_gone_is_no_error(length, monkeypatch):
    program = (
        "import sys; from roadeval.cli import app, console\n"
        f"def talk(**_): console.emit('x' * {length})\n"
        "app.app = talk\n"
        "sys.exit(app.main([]))"
    )
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        run.stdout.close()
        assert run.stderr.read() == b""
    assert run.returncode == ExitCode.BROKEN_PIPE


@pytest.mark.parametrize(
    "error", [MemoryError("std::bad_alloc"), ImportError("failed to map segment")]
)
def test_too_little_memory_is_a_known_problem(error, capsys):
    assert explain(error) == 1
    assert lines(capsys) == [
        "roadeval: error: not enough memory: give it more, or let it take less, by fewer --jobs "
        "or a smaller --scale"
    ]


@pytest.mark.parametrize(("call", "ours"), [("main()", True), ("main(['--version'])", False)])
def test_cycles_are_searched_rarely_in_a_process_of_its_own_alone(call, ours):
    code = (
        "import gc, sys; sys.argv = ['roadeval', '--version']; from roadeval.cli.app import main; "
        f"before = gc.get_threshold(); {call}; "
        "print(gc.get_threshold() != before, gc.get_freeze_count() > 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == f"{ours} {ours}"
