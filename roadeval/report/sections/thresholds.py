"""Over all thresholds: what the variants that say how probable road is could do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from roadeval.data.words import number, percent
from roadeval.evaluation.score import BINS
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.charts.thresholds import CAPTION, curves
from roadeval.report.findings import Findings
from roadeval.report.sections.common import variant_cell


def section(findings: Findings) -> Iterator[Block]:
    """Yield the curves and what is quoted of them; nothing without a probability."""
    quoted = findings.facts.curves
    charts = curves(findings.levels, quoted, findings.totals)
    if not quoted or not charts:
        return
    yield Heading("Over thresholds")
    yield Figure(charts, CAPTION)
    yield _table(findings, quoted)
    yield Text(
        "All labelled pixels of the evaluated frames together. F is the harmonic mean of precision "
        "and recall; MaxF the greatest over all thresholds, and a threshold that was chosen on the "
        "drive that it is judged on flatters. AP: the mean precision over the steps of recall, "
        "without interpolation. AUC: the area under the ROC, the chance that a road pixel has a "
        "higher probability than another one. ECE: how far the share of road in each of "
        f"{BINS} equal bins of the probability is from the mean probability there, on average over "
        "the pixels; 0 if probabilities are what they say.",
        "note",
    )


def _table(findings: Findings, quoted: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Table:
    """Tabulate areas, MaxF and calibration beside the rates of the mask as it is."""
    rows: list[list[Cell | str]] = []
    for variant, stages in quoted.items():
        for stage, own in stages.items():
            mask = findings.overlap[variant][stage]
            total = findings.totals[variant][stage]
            rows.append(
                [
                    variant_cell(variant, [*findings.totals]),
                    stage,
                    number(own["frames"]),
                    *(percent(own[name]) for name in ("AP", "AUC", "ECE")),
                    Cell(percent(own["MaxF"]), bold=True),
                    *(percent(own[name]) for name in ("threshold", "precision", "recall")),
                    *(percent(mask[name]) for name in ("F1", "precision")),
                    percent(total["pooled_TPR"]),
                ]
            )
    return Table(
        [
            *("variant", "stage", "frames", "AP", "AUC", "ECE", "MaxF", "threshold"),
            *("precision", "recall", "F1", "precision", "recall"),
        ],
        rows,
        text_columns=(0, 1),
        groups=[
            *(("", 3), ("over all thresholds", 3)),
            *(("at the best threshold", 4), ("the mask as it is", 3)),
        ],
        caption="Percent.",
        small=True,
    )
