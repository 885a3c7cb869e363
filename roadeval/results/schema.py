"""The tables of results: one schema for a drive, a rig and a fleet.

Header, lines, types, the recording's headers and the documentation follow from here. Every row
begins with its drive and camera, so that the tables of many drives are those of one, joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score import SIGNS

if TYPE_CHECKING:
    import pyarrow as pa


class Kind(StrEnum):
    """The kind of value in a column."""

    NAME = "name"
    """A word such as a variant's name: no commas, quotes or spaces."""
    TEXT = "text"
    """Any text."""
    COUNT = "count"
    """A whole number."""
    TIME = "time"
    """Nanoseconds."""
    RATE = "rate"
    """A fraction; empty where it is undefined."""
    NUMBER = "number"
    """Any other number; empty where it is undefined."""
    FLAG = "flag"
    """True or false."""


ARROW: Final = {
    Kind.NAME: "string",
    Kind.TEXT: "string",
    Kind.COUNT: "int64",
    Kind.TIME: "int64",
    Kind.RATE: "float64",
    Kind.NUMBER: "float64",
    Kind.FLAG: "bool",
}
"""The Arrow type of each kind."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table, with one line of documentation."""

    name: str
    kind: Kind
    doc: str


@dataclass(frozen=True, slots=True)
class TableSchema:
    """A table: ``<name>.csv`` in the results of a drive, ``<name>.parquet`` in those of a fleet."""

    name: str
    doc: str
    """Describes a row."""
    columns: tuple[Column, ...]
    """In the file's order."""
    streamed: bool = False
    """Whether rows are written with each frame; else they are sums over the drive."""
    of_a_fleet: tuple[Column, ...] = ()
    """Further columns in the file of a fleet."""

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return tuple(column.name for column in self.columns)

    @property
    def header(self) -> str:
        """The first line of the CSV file."""
        return ",".join(self.names) + "\n"

    def arrow(self) -> pa.Schema:
        """Return the columns with their Arrow types, those of a fleet included."""
        import pyarrow as pa

        return pa.schema([(c.name, ARROW[c.kind]) for c in (*self.columns, *self.of_a_fleet)])


SCORED: Final = "scored"
DAMAGED: Final = "damaged"
UNSCORED: Final = "unscored"
FAILED: Final = "failed"
"""The values of ``status`` in ``drives``."""
TAG: Final = "tag_"
"""Begins the name of a column of ``drives`` that holds a tag."""

DRIVE: Final = Column("drive", Kind.TEXT, "the log's name; in a fleet, its own name there")
CAMERA: Final = Column("camera", Kind.TEXT, "the image topic")
KEY: Final = (DRIVE, CAMERA)
FRAME: Final = Column("frame", Kind.COUNT, "position in the image topic by log time, from 0")
STAMP: Final = Column("stamp_ns", Kind.TIME, "header stamp")
VARIANT: Final = Column("variant", Kind.NAME, "whose mask; `blind` is the baseline")
STAGE: Final = Column("stage", Kind.NAME, "after which stage of the chain")
FINAL: Final = Column("final", Kind.FLAG, "whether that is the variant's last stage")
LABELLED: Final = Column("N", Kind.COUNT, "labelled pixels")
COUNTS: Final = (
    Column("TP", Kind.COUNT, "road classified as road, in pixels"),
    Column("TN", Kind.COUNT, "non-road classified as non-road"),
    Column("FP", Kind.COUNT, "non-road classified as road"),
    Column("FN", Kind.COUNT, "road classified as non-road"),
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
MEASURE: Final = Column("measure", Kind.NAME, "`left_edge`, `right_edge`, `free_distance`, a rate")
WHERE: Final = Column("where", Kind.NAME, "as `10m`, `ahead`, `0-10m`, `from_above`")
"""Measures of a camera that is known: metres to the left, or ahead, on flat ground."""

_OF_FRAMES: Final = (
    TableSchema(
        "frames",
        "A row per evaluated frame, variant and stage; in a fleet, in a folder per drive.",
        (
            *(*KEY, FRAME, STAMP),
            Column("log_time_ns", Kind.TIME, "when the recorder logged it"),
            *(VARIANT, STAGE, *COUNTS, *RATES),
        ),
        streamed=True,
        of_a_fleet=(FINAL,),
    ),
    TableSchema(
        "regions",
        "A row per evaluated frame, variant, stage and region.",
        (
            *(*KEY, FRAME, VARIANT, STAGE),
            Column("region", Kind.NAME, "the pixels that are counted"),
            *COUNTS,
        ),
        streamed=True,
    ),
    TableSchema(
        "oracles",
        "A row per evaluated frame, variant, stage replaced by the truth, and stage after it.",
        (
            *(*KEY, FRAME, VARIANT),
            Column("oracle", Kind.NAME, "the stage that is replaced"),
            *(STAGE, *COUNTS, *RATES),
        ),
        streamed=True,
    ),
    TableSchema(
        "disagreements",
        "A row per evaluated frame and pair of final masks.",
        (
            *(*KEY, FRAME),
            Column("from_variant", Kind.NAME, "the first mask's"),
            Column("to_variant", Kind.NAME, "the second mask's"),
            Column("repaired", Kind.COUNT, "pixels that only the second mask has right"),
            Column("spoiled", Kind.COUNT, "pixels that only the first mask has right"),
            LABELLED,
        ),
        streamed=True,
    ),
    TableSchema(
        "unlabelled",
        "A row per frame without truth and variant: how much its final mask is in doubt. By these "
        "numbers frames are ranked; none is an error rate.",
        (
            *(*KEY, FRAME, STAMP, VARIANT, STAGE),
            *(Column(sign, Kind.RATE, words) for sign, words in SIGNS.items()),
        ),
        streamed=True,
    ),
    TableSchema(
        "edges",
        "A row per evaluated frame, final mask and place where the road ends, in metres.",
        (
            *(*KEY, FRAME, VARIANT, STAGE),
            *(MEASURE, WHERE),
            Column("mask_m", Kind.NUMBER, "where the mask's road ends; empty if it does not"),
            Column("truth_m", Kind.NUMBER, "where the truth's does"),
        ),
        streamed=True,
    ),
)
_OF_SUMS: Final = (
    TableSchema(
        "windows",
        "A row per window of consecutive evaluated frames, variant and stage.",
        (
            *KEY,
            Column("window", Kind.COUNT, "from 0"),
            Column("first_frame", Kind.COUNT, "number of its first frame"),
            Column("last_frame", Kind.COUNT, "number of its last frame, inclusive"),
            Column("frames", Kind.COUNT, "evaluated frames that have this mask"),
            *(VARIANT, STAGE, *MEANS, *POOLED),
        ),
    ),
    TableSchema(
        "changes",
        "A row per mask and the one before it: stage to stage, and final mask to final mask.",
        (
            *KEY,
            Column("from_variant", Kind.NAME, "the mask before: its variant"),
            Column("from_stage", Kind.NAME, "and its stage"),
            Column("to_variant", Kind.NAME, "the mask after: its variant"),
            Column("to_stage", Kind.NAME, "and its stage"),
            Column("repaired", Kind.COUNT, "pixels of the drive that are wrong before only"),
            Column("spoiled", Kind.COUNT, "pixels of the drive that are wrong after only"),
            LABELLED,
        ),
    ),
    TableSchema(
        "heat",
        "A row per variant and square cell of the image: where the final mask errs.",
        (
            *(*KEY, VARIANT),
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
        "A row per variant, stage and level of its road probability, for curves over thresholds.",
        (
            *(*KEY, VARIANT, STAGE),
            Column("level", Kind.COUNT, "0 to 255, equally wide, from improbable to certain"),
            Column("road", Kind.COUNT, "labelled road pixels of the drive at this level"),
            Column("other", Kind.COUNT, "labelled non-road pixels"),
        ),
    ),
    TableSchema(
        "metres",
        "A row per final mask and measure on the ground; see the how-to on metres.",
        (
            *(*KEY, VARIANT, MEASURE, WHERE),
            Column("frames", Kind.COUNT, "evaluated frames on which the truth has it; 0 of a sum"),
            Column("missing", Kind.COUNT, "of these, frames on which the mask has not"),
            Column("value", Kind.NUMBER, "median of mask minus truth, outwards or ahead; or rate"),
            Column("p95", Kind.NUMBER, "95th percentile of the size of the difference"),
            Column("low", Kind.NUMBER, "least value as the camera might stand"),
            Column("high", Kind.NUMBER, "greatest value as it might stand"),
        ),
    ),
)
_OF_DRIVES: Final = (
    TableSchema(
        "drives",
        "A row per drive and camera, scored or not; a column `tag_<key>` for each tag.",
        (
            *KEY,
            Column("name", Kind.TEXT, "of its log, for people; two may have the same"),
            Column("source", Kind.TEXT, "path or URL of the log"),
            Column("group", Kind.TEXT, "drives of one day or route share one"),
            Column("fold", Kind.COUNT, "the fold whose model scored it; empty without folds"),
            Column(
                "status",
                Kind.NAME,
                "scored, damaged (scored but for what is lost), unscored (no truth), failed",
            ),
            Column("exit_code", Kind.COUNT, "that `replay` of this drive alone ends with"),
            Column("reason", Kind.TEXT, "why it was not scored"),
            Column("seconds", Kind.NUMBER, "that the last attempt took"),
            Column(
                "log_digest", Kind.NAME, "tells the log from another: of its index and checksums"
            ),
            Column("start_ns", Kind.TIME, "header stamp of the first evaluated frame"),
            Column("end_ns", Kind.TIME, "of the last one"),
            Column("rate_hz", Kind.NUMBER, "of the camera"),
            Column("width", Kind.COUNT, "of the frames, in pixels"),
            Column("height", Kind.COUNT, "of the frames, in pixels"),
            Column("in_log", Kind.COUNT, "frames of the camera's topic"),
            Column("read", Kind.COUNT, "frames that were read"),
            Column("decoded", Kind.COUNT, "frames that could be decoded"),
            Column("labelled", Kind.COUNT, "frames that have a truth"),
            Column("trained_on", Kind.COUNT, "frames left out because a model learnt from them"),
            Column("evaluated", Kind.COUNT, "frames that were scored"),
            Column("losses", Kind.TEXT, "what was lost of the log, a sentence a line"),
            Column("warnings", Kind.TEXT, "warnings, a sentence a line"),
            Column("verdict", Kind.TEXT, "the verdict on this drive alone"),
            Column("model", Kind.NAME, "SHA-256 of the model file; empty if it trained its own"),
        ),
    ),
    TableSchema(
        "scores",
        "A row per drive, camera, variant, stage and region.",
        (
            *(*KEY, VARIANT, STAGE, FINAL),
            Column("region", Kind.NAME, "the pixels that are counted; `all` is every one"),
            Column("frames", Kind.COUNT, "evaluated frames that have this mask and region"),
            *(*COUNTS, *MEANS, *POOLED),
            Column("boundary_f", Kind.RATE, "mean boundary F of the final mask"),
            Column("boundary_iou", Kind.RATE, "mean boundary IoU of the final mask"),
            Column("episodes", Kind.COUNT, "stretches of frames with an ERR of 15 % or more"),
            Column("episode_seconds", Kind.NUMBER, "how long these are, in all"),
            Column("flicker", Kind.RATE, "share of pixels that change from frame to frame"),
            Column("truth_flicker", Kind.RATE, "the same of the truth"),
        ),
    ),
    TableSchema(
        "effects",
        "A row per drive, camera, difference between two masks, and rate.",
        (
            *KEY,
            Column("base", Kind.NAME, "the variant that is subtracted: `unfiltered` or `blind`"),
            *(VARIANT, STAGE, FINAL),
            Column("metric", Kind.NAME, "the rate"),
            Column("mean", Kind.RATE, "of the frames' differences"),
            Column("standard_error", Kind.NUMBER, "of that, as frames of a drive are alike"),
            Column("low", Kind.RATE, "lower end of its interval"),
            Column("high", Kind.RATE, "upper end"),
            Column("p", Kind.RATE, "p-value of no difference"),
            Column("frames", Kind.COUNT, "frames that have a difference"),
            Column("effective_frames", Kind.NUMBER, "independent frames that tell as much"),
            Column("worse", Kind.COUNT, "frames on which it is worse than the base"),
            Column("better", Kind.COUNT, "frames on which it is better"),
        ),
    ),
    TableSchema(
        "worst",
        "A row per frame among the worst of all, by ERR of the first variant's final mask.",
        (
            Column("rank", Kind.COUNT, "1 is the worst"),
            *(*KEY, FRAME, STAMP, VARIANT, STAGE),
            *(rate for rate in RATES if rate.name in ("ERR", "FPR", "FNR")),
            Column("picture", Kind.TEXT, "its file in the fleet's folder, errors in colour"),
        ),
    ),
)

TABLES: Final[Mapping[str, TableSchema]] = {
    table.name: table for table in (*_OF_FRAMES, *_OF_SUMS, *_OF_DRIVES)
}
"""Every table by its name."""
STREAMED: Final = tuple(table.name for table in _OF_FRAMES)
"""The tables whose rows come with each frame."""
OF_A_DRIVE: Final = tuple(table.name for table in (*_OF_FRAMES, *_OF_SUMS))
"""The tables of one drive, in the order in which they are written."""
OF_DRIVES: Final = tuple(table.name for table in _OF_DRIVES)
"""The tables of a fleet beside ``frames``: each drive's rows are kept in its record."""


def blank(table: str) -> dict[str, Any]:
    """Return a row of a table without any value."""
    return dict.fromkeys(TABLES[table].names)


def documentation(tables: Iterable[str], ending: str) -> str:
    """Return tables and their columns as Markdown, as files with this ending."""
    parts = []
    for table in (TABLES[name] for name in tables):
        columns = (*table.columns, *(table.of_a_fleet if ending == "parquet" else ()))
        parts += [f"### {table.name}.{ending}", "", table.doc, ""]
        parts += ["| column | holds | meaning |", "| --- | --- | --- |"]
        parts += [f"| `{c.name}` | {c.kind} | {c.doc} |" for c in columns]
        parts.append("")
    return "\n".join(parts)
