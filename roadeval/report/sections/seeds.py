"""The rates with other seeds of the training; part of the first page."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.data import FINAL_STAGE
from roadeval.evaluation.metrics import FULL
from roadeval.report.blocks import Block, Cell, Table, Text
from roadeval.report.findings import Findings
from roadeval.report.sections.common import variant_cell
from roadeval.results.seeds import in_words, seeds_in_words, sentence, spreads


def blocks(findings: Findings) -> Iterator[Block]:
    """Yield the spread of the final masks' rates, and what it says; nothing with one seed."""
    seeds = findings.facts.seeds
    if not seeds:
        return
    yield Table(
        ["final mask", *FULL],
        rows(findings),
        caption=(
            f"Percent, with {seeds_in_words(seeds)} of the training: the middle, and from the "
            "least to the greatest."
        ),
    )
    yield Text(sentence(seeds), "note")


def rows(findings: Findings) -> list[list[Cell | str]]:
    """Return a row for each variant that learns; none with one seed."""
    totals, names = findings.facts.seeds.get("totals", {}), [*findings.finals]
    finals = {name: spreads(stages[FINAL_STAGE]) for name, stages in totals.items()}
    return [
        [variant_cell(name, names), *(in_words(own.get(rate)) for rate in FULL)]
        for name, own in finals.items()
    ]
