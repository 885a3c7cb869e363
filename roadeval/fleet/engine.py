"""Worker processes that replay the drives: of Dask, on this machine or of a cluster.

All other code sees a `concurrent.futures.Executor`, and may use another one. Python's own do not
survive the death of a worker; Dask's does, and starts the task again on another worker.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Final

from roadeval.fleet.entry import FleetError

ATTEMPTS: Final = 2
"""Attempts at a drive whose worker dies; on a cluster the scheduler's settings decide."""
ANSWER_S: Final = 15
"""Limit of a scheduler's answer."""
_LOCAL: Final = {
    "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
    # No drive waits for a busy worker while another one is idle.
    "distributed.scheduler.worker-saturation": 1.0,
    # A worker with too much memory is ended: it holds no results that could be written to a disk,
    # and a paused one would wait for ever.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # Without Dask's own MALLOC_TRIM_THRESHOLD_: with it every image is mapped and cleared again,
    # and a drive takes twice as long. Nothing is imported from the current folder: a worker
    # receives this process's own path, but only after it has imported some modules.
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "PYTHONSAFEPATH"), 1
    ),
}


@dataclass(frozen=True, slots=True)
class Engine:
    """Worker processes."""

    executor: Executor
    workers: int | None
    dashboard: str | None = None
    """Address of a page that shows their work, if there is one."""


@contextmanager
def started(
    workers: int | None = None, memory_gib: float | None = None, scheduler: str | None = None
) -> Iterator[Engine]:
    """Start worker processes here, or connect to a scheduler, until the block ends.

    Tasks that still run then are cancelled; workers that were started here end. A `FleetError` if
    the scheduler does not answer. There are ``workers`` processes here, one a processor by default.
    ``memory_gib`` is the limit of each, by default its share of the machine's: a process that takes
    more is ended, which costs its drive one attempt. ``scheduler`` is the address of a Dask
    scheduler, ``tcp://host:8786``, or the file that it has written.
    """
    import dask.system
    import distributed

    with ExitStack() as stack:
        if scheduler is None:
            stack.enter_context(dask.config.set(_LOCAL))
            count = workers or dask.system.CPU_COUNT
            client = stack.enter_context(_local(distributed, count, memory_gib))
        else:
            client = stack.enter_context(_connected(distributed, scheduler))
            count = len(client.scheduler_info(n_workers=-1)["workers"])
        executor = client.get_executor(pure=False)
        stack.callback(executor.shutdown, wait=False)
        # Without Bokeh the address shows nothing.
        page = client.dashboard_link if find_spec("bokeh") else None
        yield Engine(executor, count, page or None)


def died(error: BaseException) -> bool:
    """Return whether an error means that the workers of a task have died."""
    return type(error).__name__ in ("KilledWorker", "BrokenProcessPool", "TerminatedWorkerError")


@contextmanager
def _local(distributed: Any, count: int, memory_gib: float | None) -> Iterator[Any]:
    limit = "auto" if memory_gib is None else math.floor(memory_gib * 2**30)
    with ExitStack() as stack:
        try:
            cluster = distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                memory_limit=limit,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                worker_dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )
            client = distributed.Client(stack.enter_context(cluster))
        except (OSError, RuntimeError) as error:
            raise FleetError(
                f"the worker processes cannot be started ({error}): give them more memory, "
                "processes or open files (see ulimit -a), or take fewer `fleet.workers`"
            ) from error
        yield stack.enter_context(client)


@contextmanager
def _connected(distributed: Any, scheduler: str) -> Iterator[Any]:
    # The library logs every attempt to connect.
    log = logging.getLogger("distributed")
    before = log.level
    log.setLevel(logging.CRITICAL)
    is_file = os.path.exists(scheduler)  # noqa: PTH110 - for what is an address it is False
    try:
        try:
            where = {"scheduler_file": scheduler} if is_file else {"address": scheduler}
            client = distributed.Client(**where, timeout=ANSWER_S)
        except (OSError, TimeoutError, ValueError, TypeError) as error:
            raise FleetError(
                f"`fleet.scheduler` {scheduler}: does not answer within {ANSWER_S} s, or is no "
                "Dask scheduler; name it as tcp://host:8786, or by the file that it has written"
            ) from error
        with client:
            yield client
    finally:
        log.setLevel(before)
