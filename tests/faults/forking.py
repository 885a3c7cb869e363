"""A small process that forks the runs.

A fork copies the page tables of a whole process, and that of the tests is so large that this would
take longer than the runs. Here is one thread only, too.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Final

from tests.faults import making, steps

ROOT: Final = Path(__file__).resolve().parents[2]


class Forks:
    """The small process, which ends with the ``with`` statement."""

    def __init__(self, *modules: str) -> None:
        self._modules = modules
        """Large modules that runs import: each fork of a process without them takes longer."""

    def __enter__(self) -> Forks:
        command = [sys.executable, "-m", "tests.faults.forking", *self._modules]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe)
        assert self._process.stdin
        assert self._process.stdout
        self._asked, self._told = self._process.stdin, self._process.stdout
        return self

    def __exit__(self, *_: object) -> None:
        self._asked.close()
        self._told.close()
        self._process.wait()

    def run(self, work: Callable[[], object], hook: Callable[[str], None]) -> int:
        """Run work that can be pickled as `tests.faults.steps.run` does, in a fork."""
        pickle.dump((work, hook), self._asked)
        self._asked.flush()
        code: int = pickle.load(self._told)
        return code


def serve() -> None:
    """Run what is asked for on the standard input, until that ends."""
    # What a run prints is not an answer.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    with tempfile.TemporaryDirectory() as folder:
        # Import here what a run needs: in a fork the imports would count as its steps.
        making.run(Path(folder), "first")
        for module in sys.argv[1:]:
            import_module(module)
    while True:
        try:
            work, hook = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(steps.run(work, hook), answers)
        answers.flush()


if __name__ == "__main__":
    serve()
