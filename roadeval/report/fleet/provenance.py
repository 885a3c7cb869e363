"""The page on what was run: the settings, version, models and folds behind a fleet's results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from roadeval.data.words import number
from roadeval.report.blocks import Block, Heading, KeepTogether, Table, Text, TwoColumns
from roadeval.report.fleet.findings import FleetFindings
from roadeval.report.sections.provenance import flattened

LEFT_OUT: Final = ("output", "run")
"""Tables of the configuration that change no number."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield what was run."""
    told = findings.summary
    yield Heading("What was run")
    yield Text(f"roadeval {told['version']}; {_models(findings)}; {_seeds(told['run'])}.")
    folds = Counter(row["fold"] for row in findings.drives.values() if row["fold"] is not None)
    if folds:
        dealt = ", ".join(f"fold {fold}: {number(n)}" for fold, n in sorted(folds.items()))
        yield Text(f"Drives by the fold whose model scored them, which never saw them: {dealt}.")
    yield Text(
        f"run.toml in {findings.folder} has the whole configuration, drives.parquet each log's "
        "SHA-256. The same logs, configuration and version give the same numbers.",
        "note",
    )
    own = {name: value for name, value in told["run"].items() if name not in LEFT_OUT}
    rows = [[name, value] for name, value in flattened(own)]
    half = -(-len(rows) // 2)
    parts = (
        Table(["setting", "value"], part, text_columns=(0, 1), small=True)
        for part in (rows[:half], rows[half:])
        if part
    )
    left, *right = parts
    yield KeepTogether([Heading("Settings", 2), TwoColumns([left], right)])


def _models(findings: FleetFindings) -> str:
    models = {row["model"] for row in findings.drives.values() if row["model"]}
    if not models:
        return "each drive trained its own model"
    if len(models) == 1:
        return f"one model for all drives (SHA-256 {min(models)[:12]})"
    return f"{number(len(models))} models"


def _seeds(run: dict[str, Any]) -> str:
    training = run.get("training", {})
    seeds = training.get("seeds", 1)
    told = f"training seed {training.get('seed', 0)}"
    return told if seeds == 1 else f"{told} and {seeds - 1} more"
