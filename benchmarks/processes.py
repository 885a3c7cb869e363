"""Costs of a process of its own: peak memory, the start, and all of a command."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter

from benchmarks.timing import Cost

ROADEVAL = Path(sys.executable).with_name("roadeval")

# The system's count for a finished child includes the parent's memory at its birth, and this parent
# is large. The peak in /proc begins anew with a new program.
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
        _cost(*command)
    return {name: [_cost(*words) for _ in range(runs)] for name, words in commands.items()}


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


def _cost(*words: str) -> Cost:
    """Run a command without its output."""
    command, start = [str(ROADEVAL), *words], perf_counter()
    quiet = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
    pid = os.posix_spawn(command[0], command, os.environ, file_actions=quiet)
    _, status, used = os.wait4(pid, 0)
    if os.waitstatus_to_exitcode(status):
        raise RuntimeError(f"{command} failed")
    return Cost(perf_counter() - start, used.ru_utime + used.ru_stime)
