"""Freed memory goes back to the system where the C library has a call for it, and else stays."""

from types import SimpleNamespace

import pytest

from roadeval.runtime import memory


def test_the_c_library_is_asked_where_it_can_be(monkeypatch):
    asked = []
    library = SimpleNamespace(malloc_trim=asked.append)
    monkeypatch.setattr("ctypes.CDLL", lambda name: library)
    monkeypatch.setattr("sys.platform", "linux")
    memory.trim()
    assert asked == [0]


@pytest.mark.parametrize("platform", ["linux", "win32", "darwin"])
def test_without_such_a_call_nothing_happens(platform, monkeypatch):
    monkeypatch.setattr("ctypes.CDLL", lambda name: SimpleNamespace())
    monkeypatch.setattr("sys.platform", platform)
    memory.trim()
