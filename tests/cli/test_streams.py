"""The process's streams: closed, full, in another encoding, and kept from other libraries."""

import json
import os
import signal
import subprocess
import sys

import pytest

from roadeval.cli.app import THREADS
from roadeval.cli.exit_codes import ExitCode

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
