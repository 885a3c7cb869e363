"""``roadeval serve``: on this machine alone, nothing but what is named, until a signal."""

import os
import re
import signal
import urllib.error
import urllib.request
from contextlib import suppress
from pathlib import Path
from threading import Thread

import pytest

import roadeval
from tests.e2e.serving import serving, status


def test_a_notebook_serves_by_a_function(demo):
    addresses = []

    def ask(address):
        addresses.append(status(address))
        os.kill(os.getpid(), signal.SIGINT)

    # A shell's background process, and so the tests in it, would ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            roadeval.serve([demo.recording], lambda at: Thread(target=ask, args=[at]).start())
    finally:
        signal.signal(signal.SIGINT, before)
    assert addresses == [200]


def test_only_the_results_named_can_be_reached(address, demo):
    assert status(f"{address}0/frame/40/part") == 200
    for path in ("3/", "0/frame/99999/part", "0/pictures/summary.json", "0/frame.csv", "x"):
        assert status(address + path) == 404
    for path in ("0/../../..", "../", f"0/pictures/..{demo.recording}", "%2e%2e/"):
        assert status(address + path) == 403
    assert status(re.sub(r"/[^/]+/$", "/", address)) == 403
    view = f"{address}0/frame/40/view"
    assert status(view) == 404
    assert status(view, method="POST") == 403
    assert status(view, method="POST", Origin="http://evil.example") == 403
    assert status(address, Host="evil.example") == 403


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_at_once_and_its_port_is_free(number, demo):
    with serving(demo.recording) as (address, run):
        assert status(f"{address}0/frame/40/part") == 200
        run.send_signal(number)
        assert run.wait(60) == {signal.SIGINT: 130, signal.SIGTERM: 143}[number]
        assert "Traceback" not in run.stderr.read()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address, timeout=5)


def listening(process):
    """Addresses, as Linux writes them, on which a process and those that it started listen."""
    processes, sockets = [process], set()
    for each in processes:
        for task in Path(f"/proc/{each}/task").iterdir():
            with suppress(FileNotFoundError):  # a thread that has ended
                processes += map(int, (task / "children").read_text().split())
        for descriptor in Path(f"/proc/{each}/fd").iterdir():
            with suppress(FileNotFoundError):  # a file that was closed meanwhile
                link = str(descriptor.readlink())
                sockets |= {link[8:-1]} if link.startswith("socket:[") else set()
    rows = [
        row.split()
        for family in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{family}").read_text().splitlines()[1:]
    ]
    return [row[1].partition(":")[0] for row in rows if row[3] == "0A" and row[9] in sockets]


def test_whatever_listens_does_so_on_this_machine_alone(demo):
    with serving(demo.recording) as (address, run):
        assert status(f"{address}0/frame/40/part") == 200
        assert listening(run.pid) == ["0100007F"]
