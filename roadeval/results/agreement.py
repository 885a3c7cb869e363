"""Whether a table read back has all the rows of which its summary tells.

A file that was cut off at the end of a line reads like a shorter table, and its numbers like those
of a shorter drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, permutations
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Numbers = dict[tuple[str, ...], int]
"""What is counted of each mask, named by its variant and stage, or what else a row is about."""


def disagreement(name: str, table: pd.DataFrame, summary: Mapping[str, Any]) -> str:
    """Say where a table and the summary differ; empty if they agree, or if nothing tells.

    Parameters
    ----------
    name
        Of the table, see `roadeval.results.tables.COLUMNS`. About ``heat`` the summary tells
        nothing: it leaves out frames of another size.
    table, summary
        What was read.
    """
    masks = _masks(summary)
    match name:
        case "frames":
            return _first("frames", masks, _rows(table, "variant", "stage"))
        case "windows":
            return _first("frames", masks, _rows(table, "variant", "stage", weight="frames"))
        case "regions":
            bands = table[table["region"].str.startswith("band_")]
            each = bands["region"].nunique() or 1
            wanted = {mask: frames * each for mask, frames in masks.items()}
            return _first("bands", wanted, _rows(bands, "variant", "stage"))
        case "oracles" if "oracles" in summary:
            wanted = _oracles(summary)
            return _first("frames", wanted, _rows(table, "variant", "oracle", "stage"))
        # Summaries of earlier versions tell of neither.
        case "changes" if "oracles" in summary:
            wanted = _steps(masks, summary)
            found = _rows(table, "from_variant", "from_stage", "to_variant", "to_stage")
            return _first("rows", wanted, {step: found.get(step, 0) for step in wanted})
    return ""


def _first(unit: str, wanted: Numbers, found: Numbers) -> str:
    for key in {**wanted, **found}:
        there, told = found.get(key, 0), wanted.get(key, 0)
        if there != told:
            return f"{there} of {told} {unit} of {' '.join(key)}"
    return ""


def _rows(table: pd.DataFrame, *columns: str, weight: str | None = None) -> Numbers:
    """Count rows, or sum up a column of them, by what they are about."""
    groups = table.groupby([*columns], sort=False)
    counted = groups.size() if weight is None else groups[weight].sum()
    return dict(zip(counted.index.tolist(), counted.tolist(), strict=True))


def _masks(summary: Mapping[str, Any]) -> Numbers:
    """Count each mask's frames: a mask that the log carries may be missing on some."""
    return {
        (variant, stage): total["frames"]
        for variant, stages in summary["totals"].items()
        for stage, total in stages.items()
    }


def _oracles(summary: Mapping[str, Any]) -> Numbers:
    return {
        (variant, oracle, stage): total["frames"]
        for variant, oracles in summary["oracles"].items()
        for oracle, stages in oracles.items()
        for stage, total in stages.items()
    }


def _steps(masks: Numbers, summary: Mapping[str, Any]) -> Numbers:
    """Name the steps that ``changes`` must tell of: of masks that no evaluated frame lacks."""
    whole = [mask for mask, frames in masks.items() if frames == summary["frames"]["evaluated"]]
    within = [(*one, *next_) for one, next_ in pairwise(whole) if one[0] == next_[0]]
    last = {mask[0]: mask for mask in whole}
    across = [(*one, *other) for one, other in permutations(last.values(), 2)]
    return dict.fromkeys([*within, *across], 1)
