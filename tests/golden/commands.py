"""Every command that prints something for people, run on the tiny drive as a user runs it."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final
from unittest import mock

import pandas as pd

from roadeval.cli.app import main
from tests.golden import drive

DONE: Final = "told.json"
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
    "report_unlabelled": "report unlabelled.rrd -o unlabelled.pdf --paper letter",
    "train": "train tiny.mcap -o tiny.model --train-frames 4",
    "replay_json": "replay tiny.mcap --save model.rrd --reports model --model tiny.model "
    "--end 2.0 --record none --json",
}
"""By name, in the order in which they run."""


@dataclass(frozen=True)
class Told:
    """What the commands left in a folder."""

    folder: Path

    @cached_property
    def texts(self) -> dict[str, dict[str, Any]]:
        """What each command printed: ``code``, ``out`` and ``err``."""
        return json.loads((self.folder / DONE).read_text(encoding="utf-8"))

    def out(self, name: str) -> str:
        return self.texts[name]["out"]

    def summary(self, run: str = "paper") -> dict[str, Any]:
        return json.loads((self.folder / run / "summary.json").read_text(encoding="utf-8"))

    def table(self, name: str, run: str = "paper") -> pd.DataFrame:
        """A table as pandas reads it, without a word of the project's own reader."""
        return pd.read_csv(self.folder / run / f"{name}.csv")


def run_all(folder: Path) -> None:
    """Write the drive and run every command on it in this process, at 80 columns."""
    drive.write(folder / "tiny.mcap")
    drive.write(folder / "unlabelled.mcap", truths=False)
    (folder / "rbf.toml").write_text('[svm]\nkernel = "rbf"\n', encoding="utf-8")
    with _terminal(folder):
        texts = {name: _run(words.split()) for name, words in COMMANDS.items()}
    (folder / DONE).write_text(json.dumps(texts), encoding="utf-8")


@contextmanager
def _terminal(folder: Path) -> Iterator[None]:
    """Stand in the folder, so that every path printed is a short one, at a plain terminal."""
    plain = {"COLUMNS": "80", "LINES": "25", "TERM": "dumb"}
    gone = ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "ROADEVAL_DEBUG")
    kept = {name: value for name, value in os.environ.items() if name not in gone}
    with chdir(folder), mock.patch.dict(os.environ, {**kept, **plain}, clear=True):
        yield


def _run(words: list[str]) -> dict[str, Any]:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    return {"code": code, "out": out.getvalue(), "err": err.getvalue()}
