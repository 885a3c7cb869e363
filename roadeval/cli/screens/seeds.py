"""The table of a replay's rates with other seeds of the training."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from roadeval.cli.screens import tables
from roadeval.data import FINAL_STAGE
from roadeval.data.words import interval
from roadeval.report.blocks import Table
from roadeval.results.sentences import of_seeds, seeds_in_words, spread, spread_in_words

if TYPE_CHECKING:
    from rich.console import Console


def show(seeds: Mapping[str, Any], titles: Mapping[str, str], out: Console) -> None:
    """Print the spread of each rate of the final masks, by titles of columns, and what it says."""
    out.print(
        f"Final masks with {seeds_in_words(seeds)} of the training: the middle (and from the least "
        "to the greatest)"
    )
    rows = [
        [variant, *(spread_in_words(stages[FINAL_STAGE].get(rate, ())) for rate in titles)]
        for variant, stages in seeds["totals"].items()
    ]
    tables.show_table(Table(["variant", *titles.values()], rows), out)
    out.print()
    out.print(of_seeds(seeds))


def differences(seeds: Mapping[str, Any]) -> dict[str, str]:
    """Return by rate from where to where the filter's effect goes; nothing without seeds."""
    return {
        rate: f"{seeds_in_words(seeds)}: {tables.ascii_of(interval(least, most))}"
        for rate, values in seeds.get("difference", {}).get(FINAL_STAGE, {}).items()
        for _, least, most in filter(None, [spread(values)])
    }
