"""The commands as a user runs them.

Each command runs once and more as the installed program, in a process of its own. Where the
process adds nothing, `here` runs it in that of the tests and saves what a new one imports.
"""

import csv
import io
import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadeval.cli.app import main

ROADEVAL = Path(sys.executable).with_name("roadeval")
DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"
CLASSES = ("--road-label", 3, "--ignore-label", 11)
"""What explains the labels of a street, made or real."""

Run = subprocess.CompletedProcess[str]


def roadeval(*words: Any, cwd: Path | None = None) -> Run:
    """Run the installed command to its end."""
    command = [ROADEVAL, *map(str, words)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, timeout=300
    )


def here(*words: Any, cwd: Path | None = None) -> Run:
    """Run a command to its end in this process."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(cwd or Path.cwd()), redirect_stdout(out), redirect_stderr(err):
        code = main([*map(str, words)])
    return Run([*map(str, words)], code, out.getvalue(), err.getvalue())


@dataclass(frozen=True)
class Replayed:
    """A finished replay: what it printed and where its outputs are."""

    run: Run
    folder: Path

    @property
    def recording(self) -> Path:
        return self.folder / "out.rrd"

    @property
    def reports(self) -> Path:
        return self.folder / "reports"

    @property
    def summary(self) -> dict[str, Any]:
        return json.loads((self.reports / "summary.json").read_text())

    def table(self, name: str) -> list[dict[str, str]]:
        """The rows of ``frames``, ``windows`` or ``regions``, as text."""
        with (self.reports / f"{name}.csv").open(newline="") as file:
            return list(csv.DictReader(file))


def replay(folder: Path, drive: Path, *words: Any, run: Callable[..., Run] = here) -> Replayed:
    """Replay a drive into a folder, in this process unless told otherwise."""
    outputs = ("--save", folder / "out.rrd", "--reports", folder / "reports")
    return Replayed(run("replay", drive, *outputs, *words), folder)
