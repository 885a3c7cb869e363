"""A campaign: workers that try cases, watched from outside, and what came of it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import Final

from tests.fuzz.harness import BIG, SLOW, Outcome
from tests.fuzz.worker import Job, Progress, note

EVERY: Final = 0.2
"""Seconds from one look at a worker to the next."""
ROOT: Final = Path(__file__).resolve().parents[2]


def guidance() -> bool:
    """Whether Atheris is installed."""
    return find_spec("atheris") is not None


@dataclass
class Result:
    """What came of a harness's cases: findings are lines, by kind and by place."""

    harness: str
    cases: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    biggest: int = 0
    found: Counter[tuple[str, str, str]] = field(default_factory=Counter)

    def add(self, job: Job) -> None:
        """Add what a worker noted."""
        status = Progress(job).status
        self.cases += status.cases
        self.slowest = max(self.slowest, status.slowest)
        self.biggest = max(self.biggest, status.biggest)
        if job.found.exists():
            for line in job.found.read_text().splitlines():
                found = json.loads(line)
                self.found[found["kind"], found["where"], found["file"]] += 1


def run(jobs: list[Job], save: Path) -> Result:
    """Do jobs of one harness side by side, and keep what they find in a folder."""
    begin = monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        placed = [replace(job, folder=f"{scratch}/{number}") for number, job in enumerate(jobs)]
        workers = [Worker(job) for job in placed]
        try:
            while sum(worker.is_done() for worker in workers) < len(workers):
                sleep(EVERY)
        finally:
            for worker in workers:
                worker.stop()
        result = Result(jobs[0].harness, seconds=monotonic() - begin)
        for job in placed:
            result.add(job)
            for path in Path(job.folder).glob(f"{job.harness}-*"):
                save.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, save)
    return result


class Worker:
    """A worker's process, which is started anew after a case that ended it."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._end = monotonic() + job.seconds if job.seconds else None
        Path(job.folder).mkdir()
        self._progress = Progress(job)
        self._process = self._start()

    def is_done(self) -> bool:
        """Look after the worker; whether it has done its job."""
        code = self._process.poll()
        if code is None:
            kind = self._overdue()
            if not kind:
                return False
            self.stop()
            return self._failed(kind, f"ended after {SLOW:.0f} s or at {BIG / 1e9:.1f} GB")
        if code == 0:
            return True
        return self._failed("died", f"exit code {code}: {self._last_line()}")

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()

    def _start(self) -> subprocess.Popen[bytes]:
        job, status = self._job, self._progress.status
        left = self._end - monotonic() if self._end else 0.0
        words = json.dumps(asdict(replace(job, first=status.cases, seconds=left)))
        with Path(job.folder, "said").open("wb") as said:
            return subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker", words],
                cwd=ROOT,
                env=os.environ | {"PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT))},
                stdout=said,
                stderr=said,
            )

    def _overdue(self) -> str:
        status = self._progress.status
        if status.busy and monotonic() - status.since > SLOW:
            return "slow"
        return "big" if _resident(self._process.pid) > 2 * BIG else ""

    def _failed(self, kind: str, where: str) -> bool:
        """Note the case that ended the worker, and go on after it; whether nothing is left."""
        job, status = self._job, self._progress.status
        if not status.busy:
            raise RuntimeError(f"a worker failed before its first case: {self._last_line()}")
        note(job, Outcome(kind, where, 0, 0), job.current.read_bytes())
        self._progress.note(busy=0)
        over = self._end is not None and monotonic() >= self._end
        if over or (job.cases and status.cases >= job.cases):
            return True
        self._process = self._start()
        return False

    def _last_line(self) -> str:
        lines = Path(self._job.folder, "said").read_text(errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "")


def _resident(process: int) -> int:
    try:
        pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    except (OSError, IndexError):
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
