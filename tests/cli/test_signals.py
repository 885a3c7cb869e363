"""A signal unwinds the work by an exception."""

import os
import signal
import subprocess
import sys
from threading import Timer

import pytest

from roadeval.cli import signals
from roadeval.cli.exit_codes import ExitCode


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
