"""A comparison on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli.screens import tables
from roadeval.cli.screens.tables import Row, marked, percent, points
from roadeval.data.words import defined
from roadeval.evaluation.metrics import SHORT
from roadeval.results.certainty import correction, too_few

if TYPE_CHECKING:
    from rich.console import Console


CHANGE: Final = ("base %", "new %", "change pp", "interval pp")
LEVEL: Final = ("frames", *(f"{name} %" for name in SHORT))
"""The titles of numbers where results are subtracted, and where they stand side by side."""
Change = Mapping[str, Any]
"""A row of a comparison's ``changes``."""


def show(content: Mapping[str, Any], out: Console) -> None:
    """Print what changed, what that means, and the conditions that were kept."""
    base = content["results"][0]["label"]
    for title, rows in _groups(content["changes"]):
        if content["same_drive"]:
            out.print(f"{title} against {base}" if title else f"against {base}", soft_wrap=True)
            tables.show(("variant", "stage", "rate"), CHANGE, list(_changes(rows)), out)
        else:
            out.print(title, soft_wrap=True)
            tables.show(("variant", "stage"), LEVEL, list(_levels(rows)), out)
        if legend := correction(change["difference"].get("ERR", {}) for change in rows):
            out.print(legend)
        for change in rows:
            told = change["difference"].get("ERR")
            if change["final"] and told and told["low"] is None:
                out.print(f"{change['variant']}: {_unsure(told)}", soft_wrap=True)
        out.print()
    out.print(content["verdict"])
    for sentence in content["where"]:
        out.print(sentence)
    for condition in content["conditions"]:
        if not condition["holds"]:
            out.print(condition["sentence"], soft_wrap=True)


def _groups(changes: Sequence[Change]) -> list[tuple[str, list[Change]]]:
    """Part the rows by result; the variants of a single one stay together."""
    if all(change["result"] == change["variant"] for change in changes):
        return [("", list(changes))]
    labels = dict.fromkeys(change["result"] for change in changes)
    return [(label, [c for c in changes if c["result"] == label]) for label in labels]


def _changes(changes: Sequence[Change]) -> Iterator[Row]:
    """Yield a row for each change of ERR, and of final masks for the other rates, too."""
    for change, above in zip(changes, (None, *changes), strict=False):
        told = change["difference"]
        rates = [*SHORT] if change["final"] else ["ERR"]
        for rate in rates:
            first = rate == rates[0]
            yield Row(
                [
                    change["variant"] if first and _begins(change, above) else "",
                    change["stage"] if first else "",
                    rate,
                    percent(change["base"][rate]),
                    percent(change["new"][rate]),
                    points(told[rate]["mean"]),
                    marked(told[rate]),
                ],
                bold=change["final"] and first,
                ends=change["final"] and rate == rates[-1],
            )


def _levels(changes: Sequence[Change]) -> Iterator[Row]:
    for change, above in zip(changes, (None, *changes), strict=False):
        yield Row(
            [
                change["variant"] if _begins(change, above) else "",
                change["stage"],
                str(change["frames"]),
                *(percent(change["new"][rate]) for rate in SHORT),
            ],
            ends=change["final"],
        )


def _begins(change: Change, above: Change | None) -> bool:
    return above is None or above["variant"] != change["variant"]


def _unsure(told: Mapping[str, Any]) -> str:
    """Return why there is no interval."""
    if not defined(told["mean"]):
        return "ERR is undefined on every frame"
    return f"no interval: {too_few(told['frames'])}"
