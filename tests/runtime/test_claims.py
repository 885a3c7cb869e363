"""Claims: of the runs that would write one output, one at a time may."""

import errno
import fcntl
import os
import re
import signal
import subprocess
import sys

import pytest

from roadeval.runtime.files import claimed

HELD = """
import pathlib, sys
from roadeval.runtime.files import claimed
with claimed(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[1]).parent):
    print("held", flush=True)
    sys.stdin.read()
"""


def names(folder):
    return [path.name for path in folder.iterdir()]


@pytest.fixture
def other(tmp_path):
    """Another process that holds the claim on ``out``."""
    command = [sys.executable, "-c", HELD, tmp_path / "out"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


def claim(folder, name="out"):
    with claimed(folder / name, folder) as certain:
        return certain


def test_what_another_process_writes_is_refused_with_its_name_until_it_is_killed(other, tmp_path):
    with pytest.raises(BlockingIOError) as caught:
        claim(tmp_path)
    match = re.fullmatch(
        r"another run is writing it \(process (\d+) on \S+, since \d{4}-\d\d-\d\d \d\d:.*\)",
        caught.value.strerror,
    )
    assert int(match[1]) == other.pid
    assert claim(tmp_path, "another")
    other.send_signal(signal.SIGKILL)
    other.wait()
    assert names(tmp_path) == [".out.lock"]
    assert claim(tmp_path)
    assert names(tmp_path) == []


def test_two_in_one_process_are_two_and_the_first_one_s_lock_stays(tmp_path):
    with claimed(tmp_path / "out", tmp_path):
        for _ in range(2):
            with pytest.raises(BlockingIOError, match=f"process {os.getpid()} on"):
                claim(tmp_path)
        assert names(tmp_path) == [".out.lock"]
    assert claim(tmp_path)


def test_a_lock_that_was_removed_while_it_was_waited_for_counts_for_nothing(tmp_path, monkeypatch):
    """The run that had it ends between the moments in which the next opens and locks its file."""
    usual, removed = fcntl.flock, []

    def late(lock, how):
        if not removed:
            removed.append((tmp_path / ".out.lock").unlink())
        usual(lock, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with claimed(tmp_path / "out", tmp_path) as certain:
        assert certain
        assert names(tmp_path) == [".out.lock"]
        with pytest.raises(BlockingIOError):
            claim(tmp_path)


def test_a_dead_run_s_lock_that_is_another_user_s_is_taken_over(tmp_path, monkeypatch):
    (tmp_path / ".out.lock").write_text("process 1 on elsewhere, since long ago")
    usual = os.open

    def forbidden(path, flags, *rest):
        if flags & os.O_RDWR:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return usual(path, flags, *rest)

    monkeypatch.setattr(os, "open", forbidden)
    with claimed(tmp_path / "out", tmp_path) as certain:
        assert certain
        with pytest.raises(BlockingIOError, match="process 1 on elsewhere"):
            claim(tmp_path)
    assert names(tmp_path) == []
    with pytest.raises(PermissionError):
        claim(tmp_path)


def no_locks_of_the_system(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)


def no_locks_of_the_disk(monkeypatch):
    def fails(_file, _how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", fails)


@pytest.mark.parametrize("without", [no_locks_of_the_system, no_locks_of_the_disk])
def test_without_locks_nothing_is_certain(without, tmp_path, monkeypatch):
    without(monkeypatch)
    with claimed(tmp_path / "out", tmp_path) as one, claimed(tmp_path / "out", tmp_path) as other:
        assert (one, other) == (False, False)
    assert names(tmp_path) == []


def test_who_may_wait_has_the_claim_when_the_other_run_ends(other, tmp_path, monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _seconds: (other.kill(), other.wait()))
    with claimed(tmp_path / "out", tmp_path, wait=True) as certain:
        assert certain
