"""A comparison on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from roadeval.cli.screens.replay import percent, points
from roadeval.data.words import defined

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


Change = Mapping[str, Any]
"""A row of a comparison's ``changes``."""


def show(content: Mapping[str, Any], out: Console) -> None:
    """Print what changed, and the conditions that were kept."""
    base = content["results"][0]["label"]
    for title, rows in _groups(content["changes"]):
        if content["same_drive"]:
            out.print(f"{title} against {base}" if title else f"against {base}", soft_wrap=True)
            out.print(_differences(rows))
        else:
            out.print(title, soft_wrap=True)
            out.print(_levels(rows))
        for change in rows:
            told = change["difference"].get("ERR")
            if change["final"] and told and told["low"] is None:
                out.print(f"{change['variant']}: {_unsure(told)}", soft_wrap=True)
        out.print()
    for condition in content["conditions"]:
        if not condition["holds"]:
            out.print(condition["sentence"], soft_wrap=True)


def _groups(changes: Sequence[Change]) -> list[tuple[str, list[Change]]]:
    """Part the rows by result; the variants of a single one stay together."""
    if all(change["result"] == change["variant"] for change in changes):
        return [("", list(changes))]
    labels = dict.fromkeys(change["result"] for change in changes)
    return [(label, [c for c in changes if c["result"] == label]) for label in labels]


def _grid(*numbers: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("variant", overflow="fold")
    table.add_column("stage")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _differences(changes: Sequence[Change]) -> Table:
    table = _grid("base ERR", "new", "difference", "interval, pp")
    for change in changes:
        told = change["difference"]["ERR"]
        table.add_row(
            change["variant"],
            change["stage"],
            percent(change["base"]["ERR"]),
            percent(change["new"]["ERR"]),
            points(told["mean"]),
            _interval(told),
            style="bold" if change["final"] else None,
        )
    return table


def _levels(changes: Sequence[Change]) -> Table:
    table = _grid("frames", "ERR", "FPR", "FNR")
    for change in changes:
        rates = (percent(change["new"][rate]) for rate in ("ERR", "FPR", "FNR"))
        table.add_row(change["variant"], change["stage"], str(change["frames"]), *rates)
    return table


def _unsure(told: Mapping[str, Any]) -> str:
    """Return why there is no interval."""
    if not defined(told["mean"]):
        return "ERR is undefined on every frame"
    return f"no interval, {told['reason']}"


def _interval(told: Mapping[str, Any]) -> str:
    if not defined(told["low"]):
        return "-"
    return f"{100 * told['low']:+.2f} {100 * told['high']:+.2f}"
