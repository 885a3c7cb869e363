"""The table of a replay's rates with other seeds of the training."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from roadeval.cli.screens import tables
from roadeval.cli.screens.tables import Row, interval, percent
from roadeval.data import FINAL_STAGE
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
        Row([variant, *(_cell(own.get(rate)) for rate in titles)])
        for variant, stages in seeds["totals"].items()
        for own in (spreads(stages[FINAL_STAGE]),)
    ]
    tables.show(("variant",), [*titles.values()], rows, out)
    out.print()
    out.print(sentence(seeds))


def differences(seeds: Mapping[str, Any]) -> dict[str, str]:
    """Return by rate from where to where the filter's effect goes; nothing without seeds."""
    by_rate = spreads(seeds.get("difference", {}).get(FINAL_STAGE, {}))
    return {
        rate: f"{seeds_in_words(seeds)}: {interval(spread.least, spread.greatest)}"
        for rate, spread in by_rate.items()
        if spread
    }


def _cell(spread: Spread | None) -> str:
    return in_words(spread) if spread else percent(None)
