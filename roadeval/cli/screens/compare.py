"""A comparison on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from roadeval.cli.screens import tables
from roadeval.evaluation.comparison.compare import Comparison
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.report.comparison import changed_drives, overview
from roadeval.results.comparison import NAMED, verdict

if TYPE_CHECKING:
    from rich.console import Console


def show(comparison: Comparison, judgements: Sequence[Judgement], out: Console) -> None:
    """Print the changes in numbers, and the conditions that do not hold (others are errors)."""
    judged = [judgement for judgement in judgements if judgement.holds is not None]
    passed = [judgement for judgement in judged if not judgement.holds]
    blocks = [*overview(comparison, passed, NAMED), *changed_drives(comparison)]
    tables.show([block for block in blocks if getattr(block, "style", "") != "verdict"], out)


def show_verdict(comparison: Comparison, out: Console) -> None:
    """Print the verdict; only losses and limits follow it."""
    out.print()
    out.print(verdict(comparison), style="bold")
