"""The tables of results: one schema for a drive, a rig and a fleet.

Header, lines, types, the recording's headers and the documentation follow from it. Every row begins
with its drive and camera, so tables of many drives are the concatenated tables of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Final, NamedTuple

from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score.conditions import QUANTITIES
from roadeval.evaluation.score.unlabelled import SIGNS

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
    """A fraction; empty if it is undefined."""
    NUMBER = "number"
    """Any other number; empty if it is undefined."""
    FLAG = "flag"
    """True or false."""


TYPES: Final = dict(
    zip(Kind, ("str", "str", "int64", "int64", "float64", "float64", "bool"), strict=True)
)
"""The type of each kind, by its name in NumPy and Arrow."""


class Column(NamedTuple):
    """A column of a table."""

    name: str
    kind: Kind
    doc: str
    """Its meaning."""
    unit: str = ""

    @property
    def is_word(self) -> bool:
        """Whether it holds names or text."""
        return self.kind in (Kind.NAME, Kind.TEXT)


LATER: Final = ("truth",)
"""Columns of counts that the first files of this format lack; they are read as 0, which stands for
unknown. If any other column is missing, the file is damaged."""


class TableSchema(NamedTuple):
    """A table: ``<name>.csv`` in results of a drive, ``<name>.parquet`` in results of a fleet."""

    name: str
    doc: str
    """The meaning of a row."""
    columns: tuple[Column, ...]
    """The columns in the order of the file."""

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return tuple(column.name for column in self.columns)

    @property
    def of_a_fleet(self) -> tuple[Column, ...]:
        """Further columns in the file of a fleet."""
        return (_FINAL,) if self.name == "frames" else ()

    @property
    def header(self) -> str:
        """The first line of the CSV file."""
        return ",".join(self.names) + "\n"

    def arrow(self) -> pa.Schema:
        """Return the columns with their Arrow types, and a fleet's further columns."""
        import pyarrow as pa

        return pa.schema([(c.name, TYPES[c.kind]) for c in (*self.columns, *self.of_a_fleet)])


SCORED: Final = "scored"
DAMAGED: Final = "damaged"
UNSCORED: Final = "unscored"
FAILED: Final = "failed"
"""The values of ``status`` in ``drives``."""
TAG: Final = "tag_"
"""Prefix of a column of ``drives`` that holds a tag."""

KEY: Final = (
    Column("drive", Kind.TEXT, "name of the log; in a fleet, of the drive"),
    Column("camera", Kind.TEXT, "the image topic"),
)
"""The first columns of every table."""
_IN_FRAME: Final = (
    *KEY,
    Column("frame", Kind.COUNT, "position in the image topic by log time, from 0"),
)
_STAMP: Final = Column("stamp_ns", Kind.TIME, "header stamp")
_VARIANT: Final = Column("variant", Kind.NAME, "variant of the mask; `blind` is the baseline")
_STAGE: Final = Column("stage", Kind.NAME, "stage of the chain that made the mask")
_MASK: Final = (_VARIANT, _STAGE)
_FINAL: Final = Column("final", Kind.FLAG, "whether it is the variant's last stage")
_LABELLED: Final = Column("N", Kind.COUNT, "labelled pixels", "pixels")
_COUNTS: Final = (
    Column("TP", Kind.COUNT, "road classified as road", "pixels"),
    Column("TN", Kind.COUNT, "non-road classified as non-road", "pixels"),
    Column("FP", Kind.COUNT, "non-road classified as road", "pixels"),
    Column("FN", Kind.COUNT, "road classified as non-road", "pixels"),
    _LABELLED,
)
_RATES: Final = {
    name: Column(name, Kind.RATE, f"{metric.title}, {metric.formula}", metric.unit)
    for name, metric in METRICS.items()
}
_COUNTS_AND_RATES: Final = (*_COUNTS, *_RATES.values())
_DOUBTS: Final = tuple(Column(sign, Kind.RATE, words) for sign, words in SIGNS.items())
_QUANTITIES: Final = tuple(Column(name, Kind.NUMBER, doc) for name, doc in QUANTITIES.items())
_MEANS: Final = (
    *(Column(name, Kind.RATE, f"mean of the frames' {name}") for name in METRICS),
    *(Column(f"pooled_{name}", Kind.RATE, f"{name} of the summed counts") for name in METRICS),
)
_MEASURE: Final = (
    Column("measure", Kind.NAME, "`left_edge`, `right_edge`, `free_distance`, a rate"),
    Column("where", Kind.NAME, "place, such as `10m`, `ahead`, `0-10m`, `from_above`"),
)
"""Measures of a known camera: metres to the left, or ahead, on flat ground."""

_OF_FRAMES: Final[dict[str, tuple[Column, ...]]] = {
    "frames": (
        *_IN_FRAME,
        _STAMP,
        Column("log_time_ns", Kind.TIME, "time at which the recorder logged it"),
        *_MASK,
        *_COUNTS_AND_RATES,
        Column("truth", Kind.COUNT, "checksum of the frame's truth, equal for all masks"),
    ),
    "regions": (
        *_IN_FRAME,
        *_MASK,
        Column("region", Kind.NAME, "the pixels that are counted"),
        *_COUNTS,
    ),
    "oracles": (
        *_IN_FRAME,
        _VARIANT,
        Column("oracle", Kind.NAME, "the stage that is replaced"),
        _STAGE,
        *_COUNTS_AND_RATES,
    ),
    "disturbances": (
        *_IN_FRAME,
        Column(
            "disturbance", Kind.NAME, "its name, such as `fog-2`, `blur-0_5`, `exposure-minus1`"
        ),
        Column("kind", Kind.NAME, "the kind of the disturbance"),
        Column("strength", Kind.NUMBER, "its strength; for `jpeg` the quality"),
        *_MASK,
        *_COUNTS_AND_RATES,
    ),
    "disagreements": (
        *_IN_FRAME,
        Column("from_variant", Kind.NAME, "variant of the first mask"),
        Column("to_variant", Kind.NAME, "variant of the second mask"),
        Column("repaired", Kind.COUNT, "pixels that only the second mask has right", "pixels"),
        Column("spoiled", Kind.COUNT, "pixels that only the first mask has right", "pixels"),
        _LABELLED,
    ),
    "unlabelled": (*_IN_FRAME, _STAMP, *_MASK, *_DOUBTS),
    "conditions": (*_IN_FRAME, _STAMP, *_QUANTITIES),
    "edges": (
        *_IN_FRAME,
        *_MASK,
        *_MEASURE,
        Column("mask_m", Kind.NUMBER, "end of the mask's road; empty if there is none", "m"),
        Column("truth_m", Kind.NUMBER, "end of the truth's road", "m"),
    ),
}

_OF_SUMS: Final[dict[str, tuple[Column, ...]]] = {
    "windows": (
        *KEY,
        Column("window", Kind.COUNT, "number of the window, from 0"),
        Column("first_frame", Kind.COUNT, "number of its first frame"),
        Column("last_frame", Kind.COUNT, "number of its last frame, inclusive"),
        Column("frames", Kind.COUNT, "evaluated frames that have this mask"),
        *_MASK,
        *_MEANS,
    ),
    "changes": (
        *KEY,
        Column("from_variant", Kind.NAME, "variant of the mask before"),
        Column("from_stage", Kind.NAME, "stage of the mask before"),
        Column("to_variant", Kind.NAME, "variant of the mask after"),
        Column("to_stage", Kind.NAME, "stage of the mask after"),
        Column("repaired", Kind.COUNT, "pixels that only the mask after has right", "pixels"),
        Column("spoiled", Kind.COUNT, "pixels that only the mask before has right", "pixels"),
        _LABELLED,
    ),
    "heat": (
        *KEY,
        _VARIANT,
        Column("top", Kind.COUNT, "first row of the cell", "pixels"),
        Column("left", Kind.COUNT, "first column of the cell", "pixels"),
        Column("side", Kind.COUNT, "side of the cell", "pixels"),
        Column("labelled", Kind.COUNT, "labelled pixels of the cell, over all frames"),
        Column("FP", Kind.COUNT, "false positives of the cell, over all frames"),
        Column("FN", Kind.COUNT, "false negatives of the cell, over all frames"),
    ),
    "probabilities": (
        *KEY,
        *_MASK,
        Column("level", Kind.COUNT, "0 to 255, equally wide, from improbable to certain"),
        Column("road", Kind.COUNT, "labelled road pixels of the drive at this level", "pixels"),
        Column("other", Kind.COUNT, "labelled non-road pixels", "pixels"),
    ),
    "classes": (
        *KEY,
        _VARIANT,
        Column("class", Kind.COUNT, "value of the label, or a colour as bytes red, green, blue"),
        Column("name", Kind.TEXT, "its name, if known"),
        Column("truth", Kind.NAME, "`road`, `other` or `ignored`"),
        Column("pixels", Kind.COUNT, "pixels of the class", "pixels"),
        Column("road", Kind.COUNT, "pixels of the class that the final mask calls road", "pixels"),
        Column(
            "beside",
            Kind.COUNT,
            "missed road whose nearest non-road pixel is of this class, and at most a 75th of the "
            "image's diagonal away",
            "pixels",
        ),
        Column("frames", Kind.COUNT, "evaluated frames that have the class"),
        Column("worst", Kind.TEXT, "frames with most of its false or missed road, a second apart"),
    ),
    "parts": (
        *_IN_FRAME,
        _VARIANT,
        Column("region", Kind.TEXT, "`left` or `right` half, or `on` a class of the truth"),
        Column("wrong", Kind.COUNT, "labelled pixels that the final mask has wrong", "pixels"),
        _LABELLED,
    ),
    "metres": (
        *KEY,
        _VARIANT,
        *_MEASURE,
        Column("frames", Kind.COUNT, "evaluated frames on which the truth has it; 0 for sums"),
        Column("missing", Kind.COUNT, "number of these on which the mask misses it"),
        Column("value", Kind.NUMBER, "median of mask minus truth, outwards or ahead; or rate"),
        Column("p95", Kind.NUMBER, "95th percentile of the absolute difference"),
        Column("low", Kind.NUMBER, "least value if the camera stands or looks a little otherwise"),
        Column("high", Kind.NUMBER, "greatest value in that case"),
    ),
}

_OF_DRIVES: Final[dict[str, tuple[Column, ...]]] = {
    "drives": (
        *KEY,
        Column("name", Kind.TEXT, "name of the log; two drives may have the same name"),
        Column("source", Kind.TEXT, "path or URL of the log"),
        Column("group", Kind.TEXT, "name shared by drives of one day or route"),
        Column("fold", Kind.COUNT, "the fold whose model scored it; empty without folds"),
        Column(
            "status",
            Kind.NAME,
            "scored, damaged (scored without the lost part), unscored (no truth), failed",
        ),
        Column("exit_code", Kind.COUNT, "exit code of `replay` on this drive alone"),
        Column("reason", Kind.TEXT, "reason why it was not scored"),
        Column("seconds", Kind.NUMBER, "time that the last attempt took", "s"),
        Column("log_digest", Kind.NAME, "identity of the log, from its index and checksums"),
        Column("start_ns", Kind.TIME, "header stamp of the first evaluated frame"),
        Column("end_ns", Kind.TIME, "header stamp of the last one"),
        Column("rate_hz", Kind.NUMBER, "frame rate of the camera", "Hz"),
        Column("width", Kind.COUNT, "width of the frames", "pixels"),
        Column("height", Kind.COUNT, "height of the frames", "pixels"),
        Column("in_log", Kind.COUNT, "frames of the camera's topic"),
        Column("read", Kind.COUNT, "frames that were read"),
        Column("decoded", Kind.COUNT, "frames that could be decoded"),
        Column("labelled", Kind.COUNT, "frames that have a truth"),
        Column("trained_on", Kind.COUNT, "frames left out because a model learnt from them"),
        Column("evaluated", Kind.COUNT, "frames that were scored"),
        Column("losses", Kind.TEXT, "losses of the log, one sentence a line"),
        Column("warnings", Kind.TEXT, "warnings, one sentence a line"),
        Column(
            "misfits", Kind.TEXT, "truth or masks that do not fit the images, one sentence a line"
        ),
        Column("verdict", Kind.TEXT, "the verdict on this drive alone"),
        Column("model", Kind.NAME, "SHA-256 of the model file; empty if it trained its own"),
    ),
    "scores": (
        *KEY,
        *_MASK,
        _FINAL,
        Column("region", Kind.NAME, "the pixels that are counted; `all` is the whole frame"),
        Column("frames", Kind.COUNT, "evaluated frames that have this mask and region"),
        *_COUNTS,
        *_MEANS,
        Column("boundary_f", Kind.RATE, "mean boundary F of the final mask"),
        Column("boundary_iou", Kind.RATE, "mean boundary IoU of the final mask"),
        Column("episodes", Kind.COUNT, "stretches of frames with an ERR of 15 % or more"),
        Column("episode_seconds", Kind.NUMBER, "their total length", "s"),
        Column("flicker", Kind.RATE, "share of pixels that change from frame to frame"),
        Column("truth_flicker", Kind.RATE, "share of pixels that change in the truth"),
        Column("truth", Kind.COUNT, "checksum of all frames' truth for region `all`, else 0"),
    ),
    "effects": (
        *KEY,
        Column("base", Kind.NAME, "the variant that is subtracted: `unfiltered` or `blind`"),
        *_MASK,
        _FINAL,
        Column("metric", Kind.NAME, "the rate"),
        Column("mean", Kind.RATE, "mean of the frames' differences"),
        Column(
            "standard_error", Kind.NUMBER, "standard error of the mean, adjusted for alike frames"
        ),
        Column("low", Kind.RATE, "lower end of its interval"),
        Column("high", Kind.RATE, "upper end"),
        Column("p", Kind.RATE, "p-value of no difference"),
        Column("frames", Kind.COUNT, "frames that have a difference"),
        Column("effective_frames", Kind.NUMBER, "number of independent frames that tell as much"),
        Column("worse", Kind.COUNT, "frames on which it is worse than the base"),
        Column("better", Kind.COUNT, "frames on which it is better"),
    ),
    "worst": (
        Column("rank", Kind.COUNT, "1 is the worst"),
        *_IN_FRAME,
        _STAMP,
        *_MASK,
        *(_RATES[name] for name in ("ERR", "FNR", "FPR")),
        Column("picture", Kind.TEXT, "picture of the errors: a file in the fleet's folder"),
    ),
}

_ROWS: Final = {
    "frames": "A row per evaluated frame, variant and stage; a fleet has a file for each drive.",
    "regions": "A row per evaluated frame, variant, stage and region.",
    "oracles": "A row per evaluated frame, variant, stage replaced by the truth and later stage.",
    "disturbances": "A row per evaluated frame, disturbance and final mask.",
    "disagreements": "A row per evaluated frame and pair of final masks.",
    "unlabelled": "A row per variant and frame without truth: how uncertain the mask is.",
    "conditions": "A row per evaluated frame: measures of its image and its truth.",
    "edges": "A row per evaluated frame, final mask and edge or end of the road, in metres.",
    "windows": "A row per window of consecutive evaluated frames, variant and stage.",
    "changes": "A row per pair of masks: of consecutive stages, or of two final masks.",
    "heat": "A row per variant and cell with an error or a missing label, and for the last cell.",
    "probabilities": "A row per variant, stage and level of its road probability, for curves.",
    "classes": "A row per final mask and class of the truth, where the truth has classes.",
    "parts": "A row per evaluated frame, final mask and part of the image that has no region.",
    "metres": "A row per final mask and measure on the ground; the page on metres explains them.",
    "drives": "A row per drive and camera, scored or not; a column `tag_<key>` for each tag.",
    "scores": "A row per drive, camera, variant, stage and region.",
    "effects": "A row per drive, camera, difference between two masks, and rate.",
    "worst": "A row per frame among the worst of all, by ERR of the final mask of the focus.",
}
"""The meaning of a row of each table."""
TABLES: Final[Mapping[str, TableSchema]] = {
    name: TableSchema(name, _ROWS[name], columns)
    for name, columns in (_OF_FRAMES | _OF_SUMS | _OF_DRIVES).items()
}
"""Every table by its name."""
STREAMED: Final = (*_OF_FRAMES,)
"""The tables that get rows with each frame; other tables of a drive are sums over it."""
OF_A_DRIVE: Final = (*_OF_FRAMES, *_OF_SUMS)
"""The tables of one drive, in the order in which they are written."""
OF_DRIVES: Final = (*_OF_DRIVES,)
"""The tables of a fleet beside ``frames``."""
