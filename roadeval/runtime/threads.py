"""An ordered, bounded map over worker threads, and time limits for calls of libraries."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from threading import Thread
from typing import Final, TypeVar

from roadeval.runtime.memory import resident

T = TypeVar("T")
R = TypeVar("R")

AHEAD: Final = 2
"""Items in the queue beyond those in work, so that no worker waits for the consumer."""
WATCHED_S: Final = 0.05
"""Seconds between two looks of `time_limit` at the clock."""
_LOCAL: Final = threading.local()
"""Holds the event ``stopped`` in a thread of `map_ordered`."""


def map_ordered(work: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """Yield ``work(item)`` for every item, in the items' order, computed by ``jobs`` threads.

    At most ``jobs + 2`` items are taken ahead of the results, so that memory does not grow with
    their number. The first exception, of ``work`` or of ``items``, is raised at its place in the
    order, after the items in work have finished. If the caller stops early, they finish as well,
    and work within `time_limit` ends at once.
    """
    stopped = threading.Event()
    initializer = partial(setattr, _LOCAL, "stopped", stopped)
    with one_thread_each(), ThreadPoolExecutor(jobs, "roadeval", initializer) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) >= jobs + AHEAD:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)


def in_thread(call: Callable[[], R]) -> Future[R]:
    """Make a call in a thread of its own; the end of the process does not wait for it."""
    answer: Future[R] = Future()

    def run() -> None:
        try:
            answer.set_result(call())
        except BaseException as error:
            answer.set_exception(error)

    Thread(target=run, daemon=True).start()
    return answer


@contextmanager
def time_limit(
    end: Callable[[], None], seconds: float, grown: float = math.inf
) -> Iterator[threading.Event]:
    """Call ``end`` and set the yielded event if the block takes longer than ``seconds``.

    The same happens if the process grows by more than ``grown`` bytes. In a thread of `map_ordered`
    ``end`` is also called when the map stops early: no exception reaches the code of a library.
    """
    done, late = threading.Event(), threading.Event()
    stopped, until = getattr(_LOCAL, "stopped", done), time.monotonic() + seconds
    most = resident() + grown

    def watch() -> None:
        """End the work when it is late, too large, or stopped."""
        while not done.wait(WATCHED_S):
            if time.monotonic() > until or resident() > most:
                late.set()
            if late.is_set() or stopped.is_set():
                end()
                return

    watcher = in_thread(watch)
    try:
        yield late
    finally:
        done.set()
        watcher.result()


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Keep BLAS and OpenCV from starting threads of their own while `map_ordered` runs.

    They would compete with the threads here: on a busy machine, BLAS threads that spin while they
    wait for each other make an item ten times slower.
    """
    import cv2
    from threadpoolctl import threadpool_limits

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(before)
