"""What every room's tests share: where they begin, examples without a deadline, and the loops."""

import gc
import os
from collections.abc import Iterator
from contextlib import chdir
from importlib.util import find_spec
from unittest import mock

import pytest
from hypothesis import settings

# The machine may be busy with something else.
settings.register_profile("roadeval", deadline=None)
settings.load_profile("roadeval")

# As in a command: on busy processors the threads of OpenBLAS wait for each other longer than they
# compute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Installed without a C compiler: the twins are used as if somebody had asked for them, for who did
# not is told so by every run, and what the runs tell is compared word for word. The tests of the
# loops themselves are skipped.
if find_spec("roadeval.kernels._loops") is None:
    os.environ["ROADEVAL_PLAIN"] = "1"

# Only now: they import NumPy and the loops.
from tests.fixtures.figures import without_figures  # noqa: E402, F401
from tests.fixtures.once import once  # noqa: E402, F401

# What is imported and collected stays to the end: nothing of it is searched for again and again.
gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--write-golden",
        action="store_true",
        help="Write the golden files anew instead of comparing with them.",
    )


@pytest.fixture(scope="session", autouse=True)
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Begin in a folder that no other process has: of two runs at one place the second is refused.

    A run that is not told where to write writes below the folder it is started in.
    """
    with chdir(tmp_path_factory.mktemp("elsewhere")):
        yield


@pytest.fixture(scope="session", autouse=True)
def tables_of_colours() -> Iterator[None]:
    """Make the table of all colours once for each machine: replays of small logs train alike."""
    from roadeval.pipeline.paper import svm

    make = svm.colour_table.__wrapped__
    made: dict[object, svm.Words] = {}

    def colour_table(machine: svm.SupportVectors, settings: svm.SvmSettings) -> svm.Words:
        arrays = machine.mean, machine.scale, machine.vectors, machine.weights
        key = (settings, machine.offset, *(each.tobytes() for each in arrays))
        if key not in made:
            if len(made) == 32:  # of 2 MiB each
                made.pop(next(iter(made)))
            made[key] = make(machine, settings)
        return made[key]

    with mock.patch.object(svm, "colour_table", colour_table):
        yield
