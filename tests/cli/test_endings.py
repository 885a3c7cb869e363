"""However a command ends: a line on stderr, its exit code; signals, and streams that are closed."""

import errno
import json
import os
import signal
import subprocess
import sys
from threading import Timer

import pytest
import typer

from roadeval.cli import signals
from roadeval.cli.app import THREADS, explain, main
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.signals import Stopped
from roadeval.errors import RoadevalError


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


def test_the_draft_of_a_file_that_mends_an_error_stands_below_it(capsys):
    error = RoadevalError("lacks a size")
    error.draft = 'file = "n.onnx"\nsize = [?, ?]'
    assert explain(error) == 1
    asked = ["", 'file = "n.onnx"', "size = [?, ?]"]
    assert lines(capsys) == ["roadeval: error: lacks a size", *asked]


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


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, ExitCode.INTERRUPTED), (signal.SIGTERM, ExitCode.TERMINATED)],
)
def test_signals_at_once_are_raised_as_one_exception_that_runs_clean_up(number, code, times):
    tidied = []

    def work():
        try:
            os.kill(os.getpid(), number)
        finally:
            tidied.append("closed")

    for place in range(1, times):
        Timer(place * signals.GRACE_S / 2, os.kill, (os.getpid(), number)).start()
    with pytest.raises(signals.Stopped) as stopped, signals.as_exceptions():
        work()
    assert stopped.value.exit_code == code
    assert tidied == ["closed"]


def test_a_later_signal_would_end_the_process_at_once():
    handlers = []

    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            handlers.extend(map(signal.getsignal, (signal.SIGINT, signal.SIGTERM)))

    with pytest.raises(signals.Stopped), signals.as_exceptions():
        work()
    assert handlers == [signal.SIG_DFL, signal.SIG_DFL]


WHILE_IT_LOADS = """
import os, signal, sys

class Interrupt:
    def find_spec(name, path, target=None):
        if name == "roadeval.cli":
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, getattr(signal, sys.argv[1]))
sys.meta_path.insert(0, Interrupt)
sys.argv[1:] = ["--version"]
from roadeval.__main__ import main
sys.exit(main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill sends no SIGINT there")
@pytest.mark.parametrize(("handler", "code"), [("default_int_handler", -2), ("SIG_IGN", 0)])
def test_an_interrupt_while_the_program_loads_shows_no_traceback(handler, code):
    done = subprocess.run(
        [sys.executable, "-c", WHILE_IT_LOADS, handler], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (code, b"")


SAYS = "console.emit('gr\\xf6\\xdfe \\udce9 \\x1b[2J'); messages.warning('beware')"
OTHERS = (
    "os.write(2, b'libpng error\\n'); logging.warning('cache'); warnings.warn('font', stacklevel=1)"
)


def run(talk, redirected="", **environment):
    """Run a command that only talks, in a process whose shell redirects its streams."""
    program = (
        "import json, logging, os, sys, warnings\n"
        "from roadeval.cli import app, console, messages\n"
        f"def talk(**_): {talk}\n"
        "app.app = talk\n"
        "sys.exit(app.main())"
    )
    shell = f'"$0" "$@" {redirected}'
    variables = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return subprocess.run(
        ["/bin/sh", "-c", shell, sys.executable, "-c", program],
        env=variables | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        capture_output=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(
    ("redirected", "reason"),
    [(">&-", "Bad file descriptor"), (">/dev/full", "No space left on device")],
)
def test_a_stdout_that_takes_nothing_is_one_line(redirected, reason):
    done = run(SAYS, redirected)
    assert done.returncode == ExitCode.FAILED
    assert done.stderr.decode().splitlines()[-1] == (
        f"roadeval: error: standard output cannot be written: {reason}"
    )


@pytest.mark.parametrize("redirected", ["2>&-", "2>/dev/full"])
def test_what_nobody_hears_on_stderr_is_no_error(redirected):
    done = run(SAYS, redirected)
    assert (done.returncode, done.stdout.count(b"\n")) == (0, 1)


def test_no_file_takes_the_place_of_a_closed_stream():
    held = "assert os.open('/dev/null', os.O_RDONLY) > 2"
    assert run(held, "<&- >&- 2>&-").returncode == 0


def test_what_libraries_say_is_not_shown_unless_asked_for():
    assert run(OTHERS).stderr == b""
    loud = run(OTHERS, ROADEVAL_DEBUG="1").stderr
    assert all(word in loud for word in (b"libpng error", b"cache", b"font"))


def test_what_ends_the_process_is():
    crashed = run("os.abort()")
    assert crashed.returncode == 128 + signal.SIGABRT
    assert b"Abort" in crashed.stderr


def test_text_is_escaped_in_every_encoding_of_the_streams():
    assert run(SAYS).stdout.decode() == "größe \\udce9 \\u001b[2J\n"
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = run(SAYS, **plain)
    assert (done.returncode, done.stdout) == (0, b"gr\\u00f6\\u00dfe \\udce9 \\u001b[2J\n")
    done = run("console.emit(json.dumps('gr\\xf6\\xdfe', ensure_ascii=False))", **plain)
    assert json.loads(done.stdout) == "größe"


@pytest.mark.parametrize(
    ("environment", "threads"),
    [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2), ({"OMP_NUM_THREADS": "2"}, 2)],
)
@pytest.mark.skipif(
    sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2,
    reason="BLAS takes as many threads as there are cores, and Linux counts them",
)
def test_blas_starts_threads_only_where_the_user_asks_for_them(environment, threads, monkeypatch):
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    counted = "import numpy; console.emit(str(len(os.listdir('/proc/self/task'))))"
    assert int(run(counted, **environment).stdout) == threads
