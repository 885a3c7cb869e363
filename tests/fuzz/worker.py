"""A process that tries cases, one after the other, and notes what it is at.

It may be ended by a case, or by the campaign because of a case: whatever is needed to know which
lies in its folder. It is started by `tests.fuzz.campaign`, as
``python -m tests.fuzz.worker '{"harness": "logs", ...}'``.
"""

from __future__ import annotations

import json
import logging
import mmap
import os
import random
import struct
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import Any, Final, NamedTuple

from tests.fuzz.harness import Harness, Outcome, harness_of, run_case

ROOM: Final = 96
"""Random bytes of a case whose harness chooses by them."""
INSTRUMENTED: Final = (
    *("roadeval.config", "roadeval.images", "roadeval.logs", "roadeval.recording"),
    *("roadeval.results", "roadeval.training.model", "mcap", "mcap_ros1", "mcap_ros2"),
    *("mcap_protobuf", "zipfile", "tomllib"),
)
"""Modules whose branches guide Atheris."""


class Status(NamedTuple):
    """Cases begun, when the last of them was, the slowest's seconds, the biggest's bytes."""

    cases: int = 0
    since: float = 0.0
    slowest: float = 0.0
    biggest: int = 0
    busy: int = 0


_STATUS: Final = struct.Struct("<QddQQ")


@dataclass(frozen=True)
class Job:
    """What a worker is to do, and the folder in which it notes what it does.

    ``cases`` and ``seconds`` are limits, 0 for none; ``first`` is the number of the first case.
    """

    harness: str
    folder: str
    seed: int
    guided: bool
    cases: int
    seconds: float
    first: int = 0

    @property
    def current(self) -> Path:
        """The bytes of the case that is being tried."""
        return Path(self.folder, "current")

    @property
    def found(self) -> Path:
        """What was found, a line of JSON each."""
        return Path(self.folder, "found.jsonl")


class Progress:
    """How far a worker is, in memory that its campaign sees, too."""

    def __init__(self, job: Job) -> None:
        path = Path(job.folder, "progress")
        if not path.exists():
            path.write_bytes(_STATUS.pack(*Status()))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), _STATUS.size)

    @property
    def status(self) -> Status:
        """What was noted last."""
        return Status(*_STATUS.unpack(self._memory[:]))

    def note(self, **changed: float) -> None:
        """Note what has changed."""
        self._memory[:] = _STATUS.pack(*self.status._replace(**changed))


def note(job: Job, outcome: Outcome, data: bytes) -> None:
    """Keep a finding: its line, and the bytes that led to it."""
    key = sha256(f"{outcome.kind} {outcome.where}".encode()).hexdigest()[:10]
    path = Path(job.folder, f"{job.harness}-{outcome.kind}-{key}")
    with job.found.open("a") as file:
        line: dict[str, Any] = {"kind": outcome.kind, "where": outcome.where, "file": path.name}
        file.write(json.dumps(line) + "\n")
    if not path.exists():
        path.write_bytes(data)


def main(text: str) -> None:
    """Do a job, described in JSON."""
    job = Job(**json.loads(text))
    # As in a program that wants neither: only what no switch of Python's stops is a finding.
    logging.disable()
    warnings.simplefilter("ignore")
    if job.guided:
        _guided(job)
    else:
        _plain(job)


class Tried:
    """Tries cases of a job."""

    def __init__(self, job: Job, harness: Harness) -> None:
        self._job, self._harness, self._progress = job, harness, Progress(job)
        self._campaign = os.getppid()

    def __call__(self, data: bytes) -> None:
        """Try one; note what it is before, and what became of it afterwards."""
        if os.getppid() != self._campaign:  # which was killed: nobody waits for what is found
            os._exit(1)
        self._job.current.write_bytes(data)
        before = self._progress.status
        self._progress.note(cases=before.cases + 1, since=monotonic(), busy=1)
        outcome = run_case(self._harness, data)
        self._progress.note(
            slowest=max(before.slowest, outcome.seconds),
            biggest=max(before.biggest, outcome.memory),
            busy=0,
        )
        if outcome.kind:
            note(self._job, outcome, data)


def case_of(harness: Harness, seeds: Sequence[bytes], seed: int, number: int) -> bytes:
    """Return a case by its number, the same each time."""
    from tests.fuzz.mutation import changed

    rng = random.Random(f"{seed}/{number}")
    return rng.randbytes(ROOM) if harness.random else changed(seeds, rng)


def _plain(job: Job) -> None:
    """Try random cases."""
    harness = harness_of(job.harness)
    end = monotonic() + job.seconds if job.seconds else float("inf")
    seeds, number, attempt = harness.seeds(), job.first, Tried(job, harness)
    while (not job.cases or number < job.cases) and monotonic() < end:
        attempt(case_of(harness, seeds, job.seed, number))
        number += 1


def _guided(job: Job) -> None:
    """Try cases that Atheris makes, by the branches that the ones before have taken."""
    import atheris

    with atheris.instrument_imports(include=list(INSTRUMENTED)):
        harness = harness_of(job.harness)
        corpus = Path(job.folder, "corpus")
        corpus.mkdir(exist_ok=True)
        for number, seed in enumerate(harness.seeds()):
            Path(corpus, f"seed-{number}").write_bytes(seed)
            run_case(harness, seed)  # what is imported only now is instrumented as well
    words = [
        f"-seed={job.seed + job.first + 1}",
        "-rss_limit_mb=0",
        "-timeout=1000000",
        "-len_control=0",
    ]
    words += [f"-artifact_prefix={job.folder}/", "-verbosity=0"]
    if job.cases:
        words.append(f"-runs={job.cases - job.first}")
    if job.seconds:
        words.append(f"-max_total_time={max(round(job.seconds), 1)}")
    atheris.Setup([sys.argv[0], *words, str(corpus)], Tried(job, harness))
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1])
