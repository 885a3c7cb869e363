"""The commands as a user runs them: the installed program, in a process of its own."""

import csv
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROADEVAL = Path(sys.executable).with_name("roadeval")
DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"

Run = subprocess.CompletedProcess[str]


def roadeval(*words: Any, cwd: Path | None = None) -> Run:
    """Run the installed command to its end."""
    command = [ROADEVAL, *map(str, words)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, timeout=300
    )


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


def replay(folder: Path, drive: Path, *words: Any) -> Replayed:
    """Replay a drive into a folder."""
    run = roadeval(
        "replay", drive, "--save", folder / "out.rrd", "--reports", folder / "reports", *words
    )
    return Replayed(run, folder)
