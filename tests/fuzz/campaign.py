"""A campaign: processes that try cases, watched from outside, and what came of it.

A process may be ended by a case, or by the campaign because of a case: it notes what it is at.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import random
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import Final

from tests.fuzz.changes import changed
from tests.fuzz.harness import BIG, SLOW, Harness, Outcome, harness_of, run_case

EVERY: Final = 0.2
"""Seconds from one look at a process to the next."""
ROOT: Final = Path(__file__).resolve().parents[2]
ROOM: Final = 96
"""Random bytes of a case whose harness chooses by them."""
INSTRUMENTED: Final = (
    *("roadeval.config", "roadeval.images", "roadeval.logs", "roadeval.recording"),
    *("roadeval.results", "roadeval.training.model", "mcap", "mcap_ros1", "mcap_ros2"),
    *("mcap_protobuf", "zipfile", "tomllib"),
)
"""Modules whose branches guide Atheris."""
PROCESSES: Final = multiprocessing.get_context("spawn")
CASES, SINCE, SLOWEST, BIGGEST, BUSY = range(5)
"""Progress: cases begun, when the last of them was, the slowest's seconds, the biggest's bytes, and
whether one is being tried."""


def guidance() -> bool:
    """Whether Atheris is installed."""
    return find_spec("atheris") is not None


@dataclass(frozen=True)
class Job:
    """What a process is to do, and the folder in which it notes what it does.

    ``cases`` and ``seconds`` are limits, 0 for none; ``first`` is the number of the first case.
    """

    harness: str
    folder: str
    seed: int
    guided: bool
    cases: int
    seconds: float
    first: int = 0

    def note(self, outcome: Outcome, data: bytes) -> None:
        """Keep a finding: its line, and the bytes that led to it."""
        key = sha256(f"{outcome.kind} {outcome.where}".encode()).hexdigest()[:10]
        path = Path(self.folder, f"{self.harness}-{outcome.kind}-{key}")
        with Path(self.folder, "findings").open("a") as file:
            file.write(json.dumps([outcome.kind, outcome.where, path.name]) + "\n")
        if not path.exists():
            path.write_bytes(data)


def case_of(harness: Harness, seeds: Sequence[bytes], seed: int, number: int) -> bytes:
    """Return a case by its number, the same each time."""
    rng = random.Random(f"{seed}/{number}")
    return rng.randbytes(ROOM) if harness.random else changed(seeds, rng)


def work(job: Job, progress: MutableSequence[float]) -> None:
    """Try the cases of a job, in a process of its own."""
    with Path(job.folder, "said").open("wb") as said:
        os.dup2(said.fileno(), 1), os.dup2(said.fileno(), 2)
    # As in a program that wants neither: only what no switch of Python's stops is a finding.
    logging.disable()
    warnings.simplefilter("ignore")
    campaign = os.getppid()

    def attempt(data: bytes) -> None:
        """Try a case; note what it is before, and what became of it afterwards."""
        if os.getppid() != campaign:  # it was killed: nobody waits for what is found
            os._exit(1)
        Path(job.folder, "current").write_bytes(data)
        progress[CASES] += 1
        progress[SINCE], progress[BUSY] = monotonic(), 1
        outcome = run_case(harness, data)
        progress[SLOWEST] = max(progress[SLOWEST], outcome.seconds)
        progress[BIGGEST], progress[BUSY] = max(progress[BIGGEST], outcome.memory), 0
        if outcome.kind:
            job.note(outcome, data)

    if not job.guided:
        harness = harness_of(job.harness)
        end = monotonic() + job.seconds if job.seconds else float("inf")
        seeds, number = harness.seeds(), job.first
        while (not job.cases or number < job.cases) and monotonic() < end:
            attempt(case_of(harness, seeds, job.seed, number))
            number += 1
        return
    # Cases that Atheris makes, by the branches that the ones before have taken.
    import atheris

    with atheris.instrument_imports(include=list(INSTRUMENTED)):
        harness = harness_of(job.harness)
        corpus = Path(job.folder, "corpus")
        corpus.mkdir(exist_ok=True)
        for number, seed in enumerate(harness.seeds()):
            Path(corpus, f"seed-{number}").write_bytes(seed)
            run_case(harness, seed)  # what is imported only now is instrumented as well
    words = ["-rss_limit_mb=0", "-timeout=1000000", "-len_control=0", "-verbosity=0"]
    words += [f"-seed={job.seed + job.first + 1}", f"-artifact_prefix={job.folder}/"]
    words += [f"-runs={job.cases - job.first}"] * bool(job.cases)
    words += [f"-max_total_time={max(round(job.seconds), 1)}"] * bool(job.seconds)
    atheris.Setup([sys.argv[0], *words, str(corpus)], attempt)
    atheris.Fuzz()


@dataclass
class Result:
    """What came of a harness's cases: how often each finding, by kind, place and file."""

    harness: str
    cases: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    biggest: int = 0
    findings: Counter[tuple[str, str, str]] = field(default_factory=Counter)


def run(jobs: list[Job], save: Path) -> Result:
    """Do jobs of one harness side by side, and keep what they find in a folder."""
    begin, result = monotonic(), Result(jobs[0].harness)
    with tempfile.TemporaryDirectory() as scratch:
        workers = [Worker(replace(job, folder=f"{scratch}/{n}")) for n, job in enumerate(jobs)]
        try:
            while sum(worker.is_done() for worker in workers) < len(workers):
                sleep(EVERY)
        finally:
            for worker in workers:
                worker.stop()
        for worker in workers:
            result.cases += int(worker.progress[CASES])
            result.slowest = max(result.slowest, worker.progress[SLOWEST])
            result.biggest = max(result.biggest, int(worker.progress[BIGGEST]))
            folder = Path(worker.job.folder)
            findings = folder / "findings"
            lines = findings.read_text().splitlines() if findings.exists() else []
            result.findings.update(tuple(json.loads(line)) for line in lines)
            for path in folder.glob(f"{result.harness}-*"):
                save.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, save)
    result.seconds = monotonic() - begin
    return result


class Worker:
    """A process that does a job, and is started anew after a case that ended it."""

    def __init__(self, job: Job) -> None:
        self.job, self.progress = job, PROCESSES.Array("d", 5, lock=False)
        self._end = monotonic() + job.seconds if job.seconds else None
        Path(job.folder).mkdir()
        self._start()

    def is_done(self) -> bool:
        """Look after the process; whether it has done its job."""
        if self._process.exitcode == 0:
            return True
        if self._process.exitcode is not None:
            return self._failed("died", f"exit code {self._process.exitcode}: {self._last_line()}")
        is_slow = self.progress[BUSY] and monotonic() - self.progress[SINCE] > SLOW
        if not is_slow and _resident(self._process.pid) <= 2 * BIG:
            return False
        self.stop()
        where = f"ended after {SLOW:.0f} s or at {BIG / 1e9:.1f} GB"
        return self._failed("slow" if is_slow else "big", where)

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()

    def _start(self) -> None:
        left = self._end - monotonic() if self._end else 0.0
        job = replace(self.job, first=int(self.progress[CASES]), seconds=left)
        self._process = PROCESSES.Process(target=work, args=(job, self.progress))
        self._process.start()

    def _failed(self, kind: str, where: str) -> bool:
        """Note the case that ended the process, and go on after it; whether nothing is left."""
        if not self.progress[BUSY]:
            raise RuntimeError(f"a process failed before its first case: {self._last_line()}")
        self.job.note(Outcome(kind, where, 0, 0), Path(self.job.folder, "current").read_bytes())
        self.progress[BUSY] = 0
        over = self._end is not None and monotonic() >= self._end
        if over or (self.job.cases and self.progress[CASES] >= self.job.cases):
            return True
        self._start()
        return False

    def _last_line(self) -> str:
        lines = Path(self.job.folder, "said").read_text(errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "")


def _resident(process: int | None) -> int:
    try:
        pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    except (OSError, IndexError):
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
