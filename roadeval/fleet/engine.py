"""Dask's worker processes, on this machine or on a cluster, which replay the drives.

All other code uses a `concurrent.futures.Executor`, and may use another one. The executors of
Python do not survive the death of a worker. That of Dask starts the task again on another worker.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from roadeval.fleet.drives import FleetError
from roadeval.runtime.sentence import Sentence

ATTEMPTS: Final = 2
"""Number of attempts at a drive if workers die; on a cluster the settings of the scheduler
decide."""
ANSWER_S: Final = 15
"""Seconds in which a scheduler must answer."""
_LOCAL: Final = {
    "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
    # No drive waits for a busy worker while another one is idle.
    "distributed.scheduler.worker-saturation": 1.0,
    # A worker that uses too much memory is ended: it has no results that it could write to a disk,
    # and a paused worker would wait for ever.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # Dask's profiler looks at each worker's stack a hundred times a second; nobody reads it.
    "distributed.worker.profile.enabled": False,
    # Dask's own MALLOC_TRIM_THRESHOLD_ is left out: with it every image is mapped and cleared
    # again, and a drive takes twice as long.
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), 1
    ),
}


@contextmanager
def start_workers(
    workers: int | None = None, scheduler: str | None = None
) -> Iterator[tuple[Executor, int]]:
    """Start worker processes, or connect to a scheduler; yield an executor and its workers' number.

    At the end of the block tasks that still run are cancelled, and workers that were started here
    end. A `FleetError` if the scheduler does not answer.

    Parameters
    ----------
    workers
        The number of processes that are started, by default one per processor. A process that takes
        more than its share of the machine's memory is ended, which costs its drive one attempt.
    scheduler
        The address of a Dask scheduler, such as ``tcp://host:8786``, or the file that it has
        written.
    """
    import dask.system
    import distributed

    with ExitStack() as stack:
        if scheduler is None:
            # A worker gets the path of this process only after it has imported some modules. Until
            # then it must not import anything from the current folder.
            if not os.environ.get("PYTHONSAFEPATH"):
                os.environ["PYTHONSAFEPATH"] = "1"
                stack.callback(os.environ.pop, "PYTHONSAFEPATH", None)
            stack.enter_context(dask.config.set(_LOCAL))
            count = workers or dask.system.CPU_COUNT
            client = _start_cluster(stack, distributed, count)
        else:
            client = _connect(stack, distributed, scheduler)
            count = len(client.scheduler_info(n_workers=-1)["workers"])
        executor = client.get_executor(pure=False)
        stack.callback(executor.shutdown, wait=False)
        yield executor, count


def is_worker_death(error: BaseException) -> bool:
    """Return whether an error means that the workers of a task have died."""
    return type(error).__name__ in ("KilledWorker", "BrokenProcessPool", "TerminatedWorkerError")


def _start_cluster(stack: ExitStack, distributed: Any, count: int) -> Any:
    """Return a client of worker processes, which end with the stack."""
    try:
        cluster = distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )
        client = distributed.Client(stack.enter_context(cluster))
    except (OSError, RuntimeError) as error:
        more = "give them more memory, processes or open files (see ulimit -a)"
        raise FleetError(
            f"the worker processes cannot be started ({error})",
            remedy=Sentence("{}, or take fewer {run.jobs}", more),
        ) from error
    return stack.enter_context(client)


def _connect(stack: ExitStack, distributed: Any, scheduler: str) -> Any:
    """Return a client of a scheduler, which is closed with the stack."""
    logger = logging.getLogger("distributed")  # it would log every attempt to connect
    stack.callback(logger.setLevel, logger.level)
    logger.setLevel(logging.CRITICAL)
    is_file = os.path.exists(scheduler)  # noqa: PTH110 - an address may be no path
    try:
        place = {"scheduler_file" if is_file else "address": scheduler}
        client = distributed.Client(**place, timeout=ANSWER_S)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        raise FleetError(
            f"{scheduler} does not answer within {ANSWER_S} s, or is not a Dask scheduler",
            setting="fleet.scheduler",
            remedy="name it as tcp://host:8786, or by the file that it has written",
        ) from error
    return stack.enter_context(client)
