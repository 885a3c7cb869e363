"""The tables: their columns, what each holds, and how it is read back.

Header, lines, types, the recording's headers and the documentation follow from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from roadeval.evaluation.metrics import METRICS


class Kind(StrEnum):
    """The kind of value in a column.

    `NAME`: a word, whatever it looks like; `TEXT`: what a person reads. `COUNT`: a whole number.
    `TIME`: nanoseconds. `RATE`: a fraction, and `NUMBER` any other number; the cell is empty where
    it is undefined. `FLAG`: true or false.
    """

    NAME = "name"
    COUNT = "count"
    TIME = "time"
    RATE = "rate"
    TEXT = "text"
    NUMBER = "number"
    FLAG = "flag"


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table, with one line of documentation."""

    name: str
    kind: Kind
    doc: str


@dataclass(frozen=True, slots=True)
class TableSchema:
    """A table, in the file ``<name>.csv``.

    Parameters
    ----------
    name
        As ``frames``.
    doc
        What a row is.
    columns
        In the file's order.
    streamed
        Whether rows come with each frame; else they are sums over the drive.
    """

    name: str
    doc: str
    columns: tuple[Column, ...]
    streamed: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return tuple(column.name for column in self.columns)

    @property
    def header(self) -> str:
        """The first line of the file."""
        return ",".join(self.names) + "\n"


FRAME: Final = Column("frame", Kind.COUNT, "position in the image topic by log time, from 0")
VARIANT: Final = Column("variant", Kind.NAME, "whose mask")
STAGE: Final = Column("stage", Kind.NAME, "after which stage of the chain")
LABELLED: Final = Column("N", Kind.COUNT, "labelled pixels")
COUNTS: Final = (
    Column("TP", Kind.COUNT, "road that is taken for road, in pixels"),
    Column("TN", Kind.COUNT, "non-road that is taken for non-road"),
    Column("FP", Kind.COUNT, "non-road that is taken for road"),
    Column("FN", Kind.COUNT, "road that is taken for non-road"),
    LABELLED,
)
RATES: Final = tuple(
    Column(name, Kind.RATE, f"{metric.title}, {metric.formula} ({metric.unit})")
    for name, metric in METRICS.items()
)
MEANS: Final = tuple(
    Column(rate.name, Kind.RATE, f"mean of the frames' {rate.name}") for rate in RATES
)
POOLED: Final = tuple(
    Column(f"pooled_{rate.name}", Kind.RATE, f"{rate.name} of the summed counts") for rate in RATES
)

TABLES: Final[Mapping[str, TableSchema]] = {
    table.name: table
    for table in (
        TableSchema(
            "frames",
            "A row per evaluated frame, variant and stage.",
            (
                FRAME,
                Column("stamp_ns", Kind.TIME, "header stamp"),
                Column("log_time_ns", Kind.TIME, "when the recorder logged it"),
                *(VARIANT, STAGE, *COUNTS, *RATES),
            ),
            streamed=True,
        ),
        TableSchema(
            "regions",
            "A row per evaluated frame, variant, stage and region.",
            (
                *(FRAME, VARIANT, STAGE),
                Column("region", Kind.NAME, "the pixels that are counted"),
                *COUNTS,
            ),
            streamed=True,
        ),
        TableSchema(
            "oracles",
            "A row per evaluated frame, variant, stage replaced by the truth, and stage after it.",
            (
                *(FRAME, VARIANT),
                Column("oracle", Kind.NAME, "the stage that is replaced"),
                *(STAGE, *COUNTS, *RATES),
            ),
            streamed=True,
        ),
        TableSchema(
            "disagreements",
            "A row per evaluated frame and pair of final masks.",
            (
                FRAME,
                Column("from_variant", Kind.NAME, "whose final mask"),
                Column("to_variant", Kind.NAME, "whose other one"),
                Column("repaired", Kind.COUNT, "pixels that only the second has right"),
                Column("spoiled", Kind.COUNT, "pixels that only the first has right"),
                LABELLED,
            ),
            streamed=True,
        ),
        TableSchema(
            "windows",
            "A row per window of consecutive evaluated frames, variant and stage.",
            (
                Column("window", Kind.COUNT, "from 0"),
                Column("first_frame", Kind.COUNT, "number of its first frame"),
                Column("last_frame", Kind.COUNT, "number of its last frame, inclusive"),
                Column("frames", Kind.COUNT, "evaluated frames that have this mask"),
                *(VARIANT, STAGE),
                *(*MEANS, *POOLED),
            ),
        ),
        TableSchema(
            "changes",
            "A row per mask and the one before it: stage to stage, and final mask to final mask.",
            (
                Column("from_variant", Kind.NAME, "whose mask before"),
                Column("from_stage", Kind.NAME, "after which stage"),
                Column("to_variant", Kind.NAME, "whose mask then"),
                Column("to_stage", Kind.NAME, "after which stage"),
                Column("repaired", Kind.COUNT, "pixels of the drive that are wrong before only"),
                Column("spoiled", Kind.COUNT, "pixels of the drive that are wrong then only"),
                LABELLED,
            ),
        ),
        TableSchema(
            "heat",
            "A row per variant and square cell of the image, of the final mask's errors.",
            (
                VARIANT,
                Column("top", Kind.COUNT, "first row of the cell, in pixels"),
                Column("left", Kind.COUNT, "first column of the cell"),
                Column("side", Kind.COUNT, "of the cell, in pixels"),
                Column("labelled", Kind.COUNT, "how often a pixel of it was labelled"),
                Column("FP", Kind.COUNT, "how often one was a false positive"),
                Column("FN", Kind.COUNT, "how often one was a false negative"),
            ),
        ),
        TableSchema(
            "probabilities",
            "A row per variant, stage and level of a probability that occurs, for curves over "
            "thresholds.",
            (
                *(VARIANT, STAGE),
                Column("level", Kind.COUNT, "0 to 255, equally wide, from improbable to certain"),
                Column("road", Kind.COUNT, "labelled road pixels of the drive at this level"),
                Column("other", Kind.COUNT, "labelled non-road pixels"),
            ),
        ),
    )
}
"""The tables by name, in the order in which they are written."""


def streamed() -> dict[str, TableSchema]:
    """Return the tables whose rows come with each frame."""
    return {name: table for name, table in TABLES.items() if table.streamed}


def documentation(tables: Iterable[TableSchema] = TABLES.values(), ending: str = "csv") -> str:
    """Return tables and their columns as Markdown."""
    parts = []
    for table in tables:
        parts += [f"### {table.name}.{ending}", "", table.doc, ""]
        parts += ["| column | holds | meaning |", "| --- | --- | --- |"]
        parts += [f"| `{c.name}` | {c.kind} | {c.doc} |" for c in table.columns]
        parts.append("")
    return "\n".join(parts)
