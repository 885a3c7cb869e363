"""What only a process of its own shows: peak memory, the start, the first run of all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

ROADEVAL = Path(sys.executable).with_name("roadeval")

# What the system counts for a finished child includes the parent's memory at its birth, and this
# parent is large. The peak in /proc begins anew with a new program.
_PEAK = """
import sys
from pathlib import Path
from roadeval.cli.app import main

code = main(sys.argv[1:])
lines = Path("/proc/self/status").read_text().splitlines()
print(next(line.split()[1] for line in lines if line.startswith("VmHWM")))
sys.exit(code)
"""


def peak_mib(drive: Path, folder: Path, *words: str) -> float:
    """Peak resident memory of ``roadeval replay`` in MiB; on Linux, and of that process alone."""
    command = [sys.executable, "-c", _PEAK, *_replay(drive, folder), "--quiet", *words]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return int(run.stdout) / 1024


def help_cpu() -> float:
    """CPU seconds of ``roadeval --help``."""
    used = _run(str(ROADEVAL), "--help")
    return used.ru_utime + used.ru_stime


def seconds(drive: Path, folder: Path, *, compiled: Path | None = None) -> tuple[float, float]:
    """Seconds from the start of a replay to its first recorded frame, and to its end.

    With an empty folder for ``compiled`` code, it is the first replay on a machine.
    """
    start, first = perf_counter(), None
    command = [str(ROADEVAL), *_replay(drive, folder)]
    given = {} if compiled is None else {"NUMBA_CACHE_DIR": str(compiled)}
    with subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | given,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if first is None and line.startswith("replaying: 1 of"):
                first = perf_counter() - start
    if process.returncode or first is None:
        raise RuntimeError(f"{command} ended with {process.returncode}")
    return first, perf_counter() - start


def _replay(drive: Path, folder: Path) -> list[str]:
    outputs = "--save", folder / "out.rrd", "--reports", folder / "reports"
    return [str(word) for word in ("replay", drive, *outputs)]


def _run(*command: str) -> Any:
    quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    pid = os.posix_spawn(command[0], command, os.environ, file_actions=quiet)
    _, status, used = os.wait4(pid, 0)
    if os.waitstatus_to_exitcode(status):
        raise RuntimeError(f"{command} failed")
    return used
