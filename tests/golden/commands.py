"""Every command that prints something for people, run on the tiny drive as a user runs it."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from unittest import mock

import pandas as pd
from matplotlib.figure import Figure

from roadeval.report import blocks
from tests.e2e.commands import here
from tests.fixtures.figures import drawn
from tests.golden import drawings, drive

RANGE: Final = "--start 0.25 --train-frames 5"
COMMANDS: Final = {
    "replay": f"replay tiny.mcap --save paper.rrd --reports paper {RANGE} --train-gap 2 "
    "--max-frames 49",
    "replay_net": f"replay tiny.mcap --save printed.rrd --reports printed {RANGE} "
    "--preset printed --config rbf.toml --mask-topic net=/net/road_mask",
    "replay_unlabelled": "replay unlabelled.mcap --save unlabelled.rrd --reports unlabelled "
    "--max-frames 12 --every 4 --record every:2",
    "info": "info tiny.mcap",
    "inspect": "inspect paper.rrd --list",
    "inspect_net": "inspect printed --list --worst 3 --variant net",
    "compare": "compare paper.rrd printed.rrd -o compared.md -o compared.pdf "
    "--fail-if post.filtered.ERR>+0.5pp --fail-if svm.unfiltered.FNR>20%",
    "compare_variants": "compare printed -o variants.md -o variants.pdf",
    "report": "report paper.rrd -o paper.pdf",
    "report_folder": "report printed",
    "report_unlabelled": "report unlabelled.rrd -o unlabelled.pdf",
    "train": "train tiny.mcap -o tiny.model --train-frames 4",
    "replay_json": "replay tiny.mcap --save model.rrd --reports model --model tiny.model "
    "--end 2.0 --record none --json",
}
"""By name, in the order in which they run."""
AT_TERMINAL: Final = ("replay_net", "compare_variants")
"""Those that run at a terminal with colours; what they say on stderr is an animation there."""
_STYLES: Final = re.compile(r"\x1b\[[\d;]*m")


@dataclass(frozen=True)
class Told:
    """What the commands left in a folder."""

    texts: dict[str, dict[str, Any]]
    """What each command printed and drew: ``code``, ``out``, ``err`` and ``figures``."""
    folder: Path

    def out(self, name: str) -> str:
        """What a command printed on stdout, without its styles."""
        return _STYLES.sub("", self.texts[name]["out"])

    def summary(self, run: str = "paper") -> dict[str, Any]:
        return json.loads((self.folder / run / "summary.json").read_text(encoding="utf-8"))

    def table(self, name: str, run: str = "paper") -> pd.DataFrame:
        """A table as pandas reads it, without a word of the project's own reader."""
        return pd.read_csv(self.folder / run / f"{name}.csv")


def run_all(folder: Path) -> dict[str, dict[str, Any]]:
    """Write the drive, run every command on it, at 80 columns, and return what `Told` holds."""
    drive.write(folder / "tiny.mcap")
    drive.write(folder / "unlabelled.mcap", truths=False)
    (folder / "rbf.toml").write_text('[svm]\nkernel = "rbf"\n', encoding="utf-8")
    with terminal(folder), drawn():
        return {name: run(name) for name in COMMANDS}


@contextmanager
def terminal(folder: Path) -> Iterator[None]:
    """Stand in the folder, so that every path printed is a short one, at a plain terminal."""
    plain = {"COLUMNS": "80", "LINES": "25", "TERM": "dumb"}
    gone = ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "ROADEVAL_DEBUG")
    # What to type next depends on whether there is a screen, and where programs lie.
    plain |= {"DISPLAY": ":0"}
    plain |= {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    kept = {name: value for name, value in os.environ.items() if name not in gone}
    with chdir(folder), mock.patch.dict(os.environ, {**kept, **plain}, clear=True):
        yield


def run(name: str) -> dict[str, Any]:
    """Run a command where everything lies; return its exit code, and what it printed and drew."""
    look = {"FORCE_COLOR": "1", "TERM": "xterm"} if name in AT_TERMINAL else {}
    with mock.patch.dict(os.environ, look), _drawn() as figures:
        done = here(*COMMANDS[name].split())
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr, "figures": figures}


@contextmanager
def _drawn() -> Iterator[list[str]]:
    """Describe every figure of the paper and every chart of a report that is drawn meanwhile."""
    figures: list[str] = []
    savefig, as_json = Figure.savefig, blocks.Figure.as_json

    def save(figure: Figure, *arguments: Any, **options: Any) -> None:
        savefig(figure, *arguments, **options)
        figures.append(drawings.described(figure))

    def convert(figure: blocks.Figure) -> dict[str, Any]:
        figures.append(drawings.charted(figure))
        return as_json(figure)

    with (
        mock.patch.object(Figure, "savefig", save),
        mock.patch.object(blocks.Figure, "as_json", convert),
    ):
        yield figures
