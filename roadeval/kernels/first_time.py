"""The first time on a machine: every kernel is compiled, and its code kept for all later runs.

Compiling takes some 15 seconds and leaves 130 MiB in the process that does it, so another does.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import numpy as np

from roadeval.kernels import pick, plain
from roadeval.runtime import processes as apart


def prepare(on_compile: Callable[[], None]) -> None:
    """Compile the kernels in a process of its own if that has never been done here.

    Where it fails, each kernel is compiled when it is first called.

    Parameters
    ----------
    on_compile
        Called before, for whoever waits.
    """
    kernels = pick()
    if kernels is plain:
        return
    mark = _mark(kernels)
    if mark.exists():
        return
    on_compile()
    try:
        process = apart.start(__name__)
    except OSError:
        return
    with process:
        try:
            process.communicate()
        finally:
            process.kill()
    # Also where it failed, for it would again; but not where somebody ended it.
    if process.returncode >= 0:
        with suppress(OSError):
            mark.touch()


def _mark(compiled: ModuleType) -> Path:
    """Name the file that says so, beside the code; another for other sources or processors."""
    import llvmlite.binding as llvm
    import numba

    sources = [each.stat() for each in sorted(Path(__file__).parent.glob("*.py"))]
    made_for = [
        *((source.st_size, source.st_mtime_ns) for source in sources),
        *(sys.version, numba.__version__, llvm.get_host_cpu_name()),
    ]
    name = hashlib.blake2b(repr(made_for).encode(), digest_size=8).hexdigest()
    return Path(compiled.area.stats.cache_path) / f"roadeval-{name}.compiled"


def call_all(kernels: ModuleType) -> None:
    """Call each kernel once, on next to nothing, with the kinds of arrays that the pipeline has."""
    plane, image = np.zeros((1, 1), np.uint8), np.zeros((1, 1, 3), np.uint8)
    planes = plane, plane, plane
    runs, linear = np.zeros((0, 4), np.int32), np.zeros((1, 3))
    bits, words = np.zeros((1, 1), np.uint64), np.zeros(1 << 18, np.uint64)

    kernels.area(words)
    kernels.count_bits(bits, bits, bits)
    kernels.grow(bits, np.zeros(1, np.int64), 1, False)

    kernels.add_outcomes(plane, np.zeros((3, 1, 1), np.uint8))
    kernels.look_up_channels(image, np.zeros((256, 3), np.uint8))
    kernels.look_up_colours(planes, words, words)
    kernels.look_up_levels(plane, np.zeros(256, np.uint8))
    kernels.look_up_sum_min(planes, np.zeros((766, 256), np.uint8))
    kernels.mahalanobis(planes, np.zeros(3), np.eye(3), 1.0)
    kernels.outcomes(plane, plane)

    kernels.components(bits, 1, 8)
    kernels.fill_holes(bits, 1)
    kernels.keep_region(bits, 1, plane)
    kernels.label_runs(np.zeros((1, 1), np.int32))

    kernels.paint(runs, 1, 1)
    kernels.ring_sums(planes, runs, bits, 1, 1)
    kernels.run_sums(planes, runs, 1)
    kernels.transfer(image, runs, linear, linear, linear)

    # The machine's kernel is made for a number of features: these are the default's.
    feature = np.zeros(1, np.float32)
    kernels.rectified_sum((feature,) * 11, np.zeros((1, 11), np.float32), feature, feature)
    kernels.climb(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32))


if __name__ == "__main__":
    call_all(pick())
