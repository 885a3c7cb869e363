"""Memory: freed where the C library has a call for it, and told where there is not enough."""

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


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        MemoryError("std::bad_alloc"),
        ImportError("libavcodec.so: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
    ],
)
def test_an_error_that_means_too_little_memory_is_known(error):
    assert memory.is_lacking(error)


@pytest.mark.parametrize(
    "error", [ImportError("no module named x"), ValueError("cannot allocate"), RuntimeError("x")]
)
def test_another_one_is_not(error):
    assert not memory.is_lacking(error)
