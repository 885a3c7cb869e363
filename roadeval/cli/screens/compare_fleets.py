"""A comparison of two fleets on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli.screens import tables
from roadeval.cli.screens.tables import Row, interval, percent, points
from roadeval.data import BASELINE
from roadeval.evaluation.metrics import SHORT
from roadeval.results.certainty import MARK, correction, stands

if TYPE_CHECKING:
    from rich.console import Console

TESTED: Final = "ERR"
CHANGE: Final = ("base %", "new %", "change pp", "interval pp")
DRIVE: Final = ("base %", "new %", "change pp", "interval pp", "q")
NAMED: Final = 10
"""Drives that changed, which are named for each variant."""


def show(content: Mapping[str, Any], out: Console) -> None:
    """Print what changed over drives, which drives changed, and the conditions that were kept."""
    base, new = content["fleets"]
    drives = content["drives"]
    out.print(
        f"{new['label']} against {base['label']}: {drives} drive{'' if drives == 1 else 's'} "
        "scored in both",
        soft_wrap=True,
    )
    if content["changes"]:
        tables.show(("variant", "stage", "rate"), CHANGE, list(_changes(content["changes"])), out)
        if legend := correction(content["changes"]):
            out.print(legend)
    out.print()
    _show_drives(content, out)
    out.print(content["verdict"])
    for condition in content["conditions"]:
        if not condition["holds"]:
            out.print(condition["sentence"], soft_wrap=True)


def _changes(changes: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Yield a row for each change of ERR, and of final masks for the other rates, too."""
    for change, above in zip(changes, (None, *changes), strict=False):
        begins = above is None or above["variant"] != change["variant"]
        rates = [*SHORT] if change["final"] else [TESTED]
        for rate in rates:
            first, told = rate == rates[0], change["difference"][rate]
            marked = rate == TESTED and stands(change["p_holm"], told["confidence"])
            yield Row(
                [
                    change["variant"] if first and begins else "",
                    change["stage"] if first else "",
                    rate,
                    percent(change["base"][rate]),
                    percent(change["new"][rate]),
                    points(told["mean"]),
                    f"{interval(told['low'], told['high'])} {MARK if marked else ' '}",
                ],
                bold=change["final"] and first,
                ends=change["final"] and rate == rates[-1],
            )


def _show_drives(content: Mapping[str, Any], out: Console) -> None:
    """Print the drives that changed, the surest first."""
    rows = content["drive_changes"]
    rate = content["false_discovery_rate"]
    for variant in dict.fromkeys(row["variant"] for row in rows if row["variant"] != BASELINE):
        own = [row for row in rows if row["variant"] == variant]
        changed = [row for row in own if row["changed"]]
        tested = sum(row["q"] is not None for row in own)
        worse = sum(row["mean"] > 0 for row in changed)
        out.print(
            f"{variant}: {TESTED} changed on {len(changed)} of {tested} drives (worse on {worse}, "
            f"better on {len(changed) - worse}; false discovery rate {rate:.0%})"
        )
        if changed:
            tables.show(("drive",), DRIVE, [_drive(row) for row in changed[:NAMED]], out)
            if len(changed) > NAMED:
                out.print(f"and {len(changed) - NAMED} more; --json and -o name them all")
        out.print()


def _drive(row: Mapping[str, Any]) -> Row:
    return Row(
        [
            row["name"],
            percent(row["base"]),
            percent(row["new"]),
            points(row["mean"]),
            interval(row["low"], row["high"]),
            "<0.001" if row["q"] < 0.001 else f"{row['q']:.3f}",
        ]
    )
