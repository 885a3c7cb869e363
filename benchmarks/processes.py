"""Costs of a process of its own: peak memory, the start, and all of a command."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from time import perf_counter

from benchmarks.timing import Cost

ROADEVAL = Path(sys.executable).with_name("roadeval")

# The system's count for a finished child includes the parent's memory at its birth, and this parent
# is large. The peak in /proc begins anew with a new program.
_PEAK = """
import sys
from pathlib import Path
from roadeval.__main__ import main

peak = Path(sys.argv.pop(1))
try:
    code = main()
finally:
    lines = Path("/proc/self/status").read_text().splitlines()
    peak.write_text(next(line.split()[1] for line in lines if line.startswith("VmHWM")))
sys.exit(code)
"""


@dataclass(frozen=True)
class CommandCost(Cost):
    """The cost of a command, CPU time that of all its processes."""

    peak_mib: float
    """Peak resident memory of its first process; on Linux."""


def run(*words: object) -> CommandCost:
    """Run a command of roadeval without its output, and return its cost."""
    with NamedTemporaryFile("r") as peak:
        command = [sys.executable, "-c", _PEAK, peak.name, *map(str, words)]
        cost = _cost(command)
        return CommandCost(cost.wall, cost.cpu, int(peak.read()) / 1024)


def peak_mib(drive: Path, folder: Path) -> float:
    """Peak resident memory of ``roadeval replay`` in MiB; on Linux, and of that process alone."""
    return run(*_replay(drive, folder), "--quiet").peak_mib


def costs(short: Path, drive: Path, folder: Path, runs: int = 5) -> dict[str, list[Cost]]:
    """Return the costs of several runs of each command, by its purpose.

    CPU is that of all its processes. A round before all warms the disk's cache, and leaves the
    recordings that the others read.
    """
    replays = {log: _replay(log, folder / log.stem) for log in (short, drive)}
    result = str(folder / drive.stem / "out.rrd")
    commands = {
        "--help": ["--help"],
        "info": ["info", str(drive)],
        "replay, short": [*replays[short], "--quiet"],
        "replay": [*replays[drive], "--quiet"],
        "report": ["report", result, "-o", str(folder / "report.pdf")],
        "compare of two": ["compare", result, result],
        "compare of two folders": ["compare", *2 * [str(folder / drive.stem / "reports")]],
        "inspect --list": ["inspect", "--list", result],
    }
    for command in commands.values():
        _cost([str(ROADEVAL), *command])
    return {
        name: [_cost([str(ROADEVAL), *words]) for _ in range(runs)]
        for name, words in commands.items()
    }


def seconds(drive: Path, folder: Path) -> tuple[float, float]:
    """Seconds from the start of a replay to its first recorded frame, and to its end."""
    start, first = perf_counter(), None
    command = [str(ROADEVAL), *_replay(drive, folder)]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
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


def _cost(command: list[str]) -> Cost:
    """Run a program without its output."""
    start = perf_counter()
    quiet = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
    pid = os.posix_spawn(command[0], command, os.environ, file_actions=quiet)
    _, status, used = os.wait4(pid, 0)
    if os.waitstatus_to_exitcode(status):
        raise RuntimeError(f"{command} failed")
    return Cost(perf_counter() - start, used.ru_utime + used.ru_stime)
