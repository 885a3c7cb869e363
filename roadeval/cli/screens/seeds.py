"""The table of a replay's rates with other seeds of the training."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from roadeval.cli.screens import tables
from roadeval.data import FINAL_STAGE
from roadeval.data.words import interval, percent
from roadeval.report.blocks import Table
from roadeval.results.seeds import Spread, in_words, seeds_in_words, sentence, spreads

if TYPE_CHECKING:
    from rich.console import Console


def show(seeds: Mapping[str, Any], titles: Mapping[str, str], out: Console) -> None:
    """Print the spread of each rate of the final masks, and what it says.

    Parameters
    ----------
    seeds
        As ``seeds`` in ``summary.json``.
    titles
        The rates to show, with the titles of their columns.
    out
        Where to.
    """
    out.print(
        f"Final masks with {seeds_in_words(seeds)} of the training: the middle (and from the least "
        "to the greatest)"
    )
    rows = [
        [variant, *(_cell(own.get(rate)) for rate in titles)]
        for variant, stages in seeds["totals"].items()
        for own in (spreads(stages[FINAL_STAGE]),)
    ]
    tables.show_table(Table(["variant", *titles.values()], rows), out)
    out.print()
    out.print(sentence(seeds))


def differences(seeds: Mapping[str, Any]) -> dict[str, str]:
    """Return by rate from where to where the filter's effect goes; nothing without seeds."""
    by_rate = spreads(seeds.get("difference", {}).get(FINAL_STAGE, {}))
    return {
        rate: f"{seeds_in_words(seeds)}: {tables.ascii_of(told)}"
        for rate, spread in by_rate.items()
        if spread
        for told in [interval(spread.least, spread.greatest)]
    }


def _cell(spread: Spread | None) -> str:
    return in_words(spread) if spread else percent(None)
