"""An ordered, bounded map over worker threads, and single calls that may never return."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Thread
from typing import Final, TypeVar

T = TypeVar("T")
R = TypeVar("R")

AHEAD: Final = 2
"""Items in the queue beyond those in work, so that no worker waits for the consumer."""


def ordered(work: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """Yield ``work(item)`` for every item, in the items' order, computed by ``jobs`` threads.

    The items are drawn as results are taken, at most ``jobs + 2`` ahead (back-pressure: memory
    does not grow with their number). The first exception, of ``work`` or of ``items``, is
    raised at its place in the order, after the items in work have finished. The same happens when
    the caller stops early.
    """
    with one_thread_each(), ThreadPoolExecutor(jobs, thread_name_prefix="roadeval") as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) >= jobs + AHEAD:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
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
def one_thread_each() -> Iterator[None]:
    """Keep BLAS and OpenCV from starting threads of their own while `ordered` runs.

    They would compete with the threads here: on a busy machine BLAS threads that spin while they
    wait for each other made an item ten times slower.
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
