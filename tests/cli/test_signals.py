"""A signal unwinds the work by an exception."""

import os
import signal
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
    with pytest.raises(signals.Stopped) as stopped, signals.raised():
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

    with pytest.raises(signals.Stopped), signals.raised():
        work()
    assert handlers == [signal.SIG_DFL, signal.SIG_DFL]


def test_the_earlier_handlers_come_back():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with signals.raised():
        assert signal.getsignal(signal.SIGTERM) != before[1]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
