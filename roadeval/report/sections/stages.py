"""Which stage broke it: the rates of every stage, and the stages' parts of the final error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import DASH, number, percent, points
from roadeval.evaluation.metrics import SHORT, SHORT_OVERLAP
from roadeval.evaluation.score import FILTER, merged
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.charts import rates
from roadeval.report.findings import Findings
from roadeval.report.sections.common import rate_cells, sampled_frames, variant_cell


def section(findings: Findings) -> Iterator[Block]:
    """Yield what each stage did to the mask, and which part of the error is whose."""
    yield Heading("Which stage broke it")
    yield Figure(
        rates.stages(findings.totals),
        f"Rates of each stage's mask, means over the frames; {BASELINE}, which has no stages, for "
        "scale.",
    )
    yield stages_table(findings)
    if findings.changes:
        yield Text(
            "Repaired and spoiled: labelled pixels that the stage has right and the mask before it "
            f"wrong, and the reverse, over {sampled_frames(findings)}.",
            "note",
        )
    yield Heading("How the error of the final mask comes about", 2)
    yield _parts_table(findings)
    yield Text(_parts_note(findings), "note")
    yield from _oracles(findings)


def stages_table(findings: Findings) -> Table:
    """Tabulate the rates of every stage, and the pixels that it repaired and spoiled."""
    rows: list[list[Cell | str]] = []
    breaks = []
    for variant, stages in findings.totals.items():
        breaks.append(len(rows))
        for place, (stage, total) in enumerate(stages.items()):
            repaired, spoiled = findings.changes.get((variant, stage), (None, None))
            rows.append(
                [
                    variant_cell(variant, [*findings.totals]) if place == 0 else "",
                    stage,
                    *rate_cells(total, bold=stage == findings.finals[variant]),
                    *(percent(findings.overlap[variant][stage][name]) for name in SHORT_OVERLAP),
                    percent(repaired),
                    percent(spoiled),
                ]
            )
    meanings = "; ".join(f"{name}: {metric.in_words}" for name, metric in SHORT.items())
    return Table(
        ["variant", "stage", *SHORT, *SHORT_OVERLAP, "repaired", "spoiled"],
        rows,
        text_columns=(0, 1),
        breaks=breaks[1:],
        caption=f"Percent. {meanings}.",
    )


def _parts_table(findings: Findings) -> Table:
    """Tabulate the mean ERR of each final mask as a sum over its stages."""
    columns = merged(findings.error_parts.values())
    return Table(
        ["final mask", *columns, "ERR"],
        [
            [
                variant_cell(variant, [*findings.totals]),
                *(_part(parts, part) for part in columns),
                Cell(percent(findings.total(variant)["ERR"]), bold=True),
            ]
            for variant, parts in findings.error_parts.items()
        ],
    )


def _part(parts: Mapping[str, float], part: str) -> str:
    if part not in parts:
        return DASH
    first = part == next(iter(parts))
    return percent(parts[part]) if first else points(parts[part])


def _parts_note(findings: Findings) -> str:
    first, *rest = max(findings.error_parts.values(), key=len)
    meanings = "".join(f"; {part}: {_meaning(part)}" for part in rest)
    return (
        f"A sum, in percent of the pixels. {first}: the error of the mask that the last stage is "
        f"given, without the filter{meanings}. Percentage points add up to ERR."
    )


def _meaning(part: str) -> str:
    if part == FILTER:
        return f"what {FILTERED} has more or less than {UNFILTERED} in that mask"
    return f"what {part} made of it"


def _oracles(findings: Findings) -> Iterator[Block]:
    """Yield what remains when a stage is replaced by the truth, where the run counted that."""
    if not findings.oracles:
        return
    yield Heading("If a stage were perfect", 2)
    yield Table(
        [
            *("variant", "if there were a", "ERR as it is", "ERR then", "change, pp"),
            *(*(f"{name} then" for name in SHORT if name != "ERR"), "frames"),
        ],
        [
            [
                variant_cell(row["variant"], [*findings.totals]),
                f"perfect {row['oracle']}",
                percent(row["as_is"]),
                Cell(percent(row["ERR"]), bold=True),
                points(row["ERR"] - row["as_is"]),
                *(percent(row[name]) for name in SHORT if name != "ERR"),
                number(row["frames"]),
            ]
            for row in findings.oracles
        ],
        text_columns=(0, 1),
        small=True,
    )
    yield Text(
        "Oracles: the stage's output replaced by the truth while replaying, and the stages after "
        "it run on that; ignored pixels count as non-road, or lit. No result, but a bound on "
        "what mending the stage could bring, and what the stages after it lose by themselves.",
        "note",
    )
