"""The tables of a fleet: their columns, and what each holds.

Records, files, readers and the documentation follow from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from roadeval.results.schema import COUNTS, FRAME, MEANS, POOLED, RATES, Column, Kind, TableSchema

FORMAT: Final = {"name": "roadeval-fleet", "version": 1}
"""Of the folder, its records and tables; the version rises where a column changes its meaning."""
TAG: Final = "tag_"
"""Begins the name of a column of ``drives`` that holds a tag."""

ALL: Final = "all"
"""The region that every labelled pixel is in."""

DRIVE: Final = Column("drive", Kind.NAME, "of the drive, its own in the fleet")
_STAMP: Final = Column("stamp_ns", Kind.TIME, "header stamp")
_MASK: Final = (
    Column("variant", Kind.NAME, "whose mask; `blind` is the baseline"),
    Column("stage", Kind.NAME, "after which stage of the chain"),
    Column("final", Kind.FLAG, "whether that is the variant's last one"),
)
LIGHT: Final = (
    Column("luminance", Kind.RATE, "mean brightness of the image, from 0 to 1"),
    Column("contrast", Kind.RATE, "standard deviation of the brightness"),
    Column("shadow", Kind.RATE, "share of the image's lower half that is dark beside its lit part"),
    Column("sun", Kind.NUMBER, "how much bluer grey things are there: above 0 in the sun"),
)
"""The light, measured from the images: see `roadeval.evaluation.light`."""

TABLES: Final[Mapping[str, TableSchema]] = {
    table.name: table
    for table in (
        TableSchema(
            "drives",
            "A row per drive, scored or not; a column `tag_<key>` for each tag that some drive "
            "has.",
            (
                DRIVE,
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
                Column("attempts", Kind.COUNT, "how often it was begun"),
                Column("seconds", Kind.NUMBER, "that the last attempt took"),
                Column("peak_memory_mib", Kind.NUMBER, "the most memory that its process held"),
                Column("sha256", Kind.NAME, "of the log"),
                Column("size_bytes", Kind.COUNT, "of the log"),
                Column("start_ns", Kind.TIME, "header stamp of the first evaluated frame"),
                Column("end_ns", Kind.TIME, "of the last one"),
                Column("rate_hz", Kind.NUMBER, "of the camera"),
                Column("width", Kind.COUNT, "of the frames, in pixels"),
                Column("height", Kind.COUNT, "of the frames, in pixels"),
                Column("in_log", Kind.COUNT, "frames of the camera's topic"),
                Column("read", Kind.COUNT, "frames that were read"),
                Column("decoded", Kind.COUNT, "frames that could be decoded"),
                Column("labelled", Kind.COUNT, "frames that have a truth"),
                Column(
                    "trained_on", Kind.COUNT, "frames left out because a model learnt from them"
                ),
                Column("evaluated", Kind.COUNT, "frames that were scored"),
                Column("losses", Kind.TEXT, "what was lost of the log, a sentence a line"),
                Column("warnings", Kind.TEXT, "what to know first, a sentence a line"),
                Column("verdict", Kind.TEXT, "what the drive alone tells"),
                Column(
                    "model", Kind.NAME, "SHA-256 of the model file; empty if it trained its own"
                ),
                Column("identity", Kind.NAME, "digest of log, settings, model and version"),
                *LIGHT,
            ),
        ),
        TableSchema(
            "scores",
            "A row per drive, variant, stage and region.",
            (
                DRIVE,
                *_MASK,
                Column("region", Kind.NAME, "the pixels that are counted; `all` is every one"),
                Column("frames", Kind.COUNT, "evaluated frames that have this mask and region"),
                *COUNTS,
                *MEANS,
                *POOLED,
                Column("boundary_f", Kind.RATE, "mean boundary F of the final mask"),
                Column("flicker", Kind.RATE, "share of pixels that change from frame to frame"),
                Column("truth_flicker", Kind.RATE, "the same of the truth"),
            ),
        ),
        TableSchema(
            "effects",
            "A row per drive, difference between two masks, and rate.",
            (
                DRIVE,
                Column("kind", Kind.NAME, "`filter`: with it minus without; `blind`: minus that"),
                *_MASK,
                Column("base", Kind.NAME, "the variant that is subtracted"),
                Column("metric", Kind.NAME, "the rate"),
                Column("mean", Kind.RATE, "of the frames' differences"),
                Column("standard_error", Kind.NUMBER, "of that, as frames of a drive are alike"),
                Column("low", Kind.RATE, "lower end of its interval"),
                Column("high", Kind.RATE, "upper end"),
                Column("p", Kind.RATE, "p-value of no difference"),
                Column("frames", Kind.COUNT, "frames that have a difference"),
                Column("effective_frames", Kind.NUMBER, "independent frames that tell as much"),
                Column("base_wrong", Kind.COUNT, "wrong pixels of the base on all its frames"),
                Column("base_N", Kind.COUNT, "labelled pixels of the base's frames"),
                Column("wrong", Kind.COUNT, "wrong pixels of the variant on all its frames"),
                Column("N", Kind.COUNT, "labelled pixels of the variant's frames"),
            ),
        ),
        TableSchema(
            "worst",
            "A row per frame among the worst of all, by ERR of the first variant's final mask.",
            (
                Column("rank", Kind.COUNT, "1 is the worst"),
                DRIVE,
                FRAME,
                _STAMP,
                *_MASK[:2],
                *(rate for rate in RATES if rate.name in ("ERR", "FPR", "FNR")),
                Column("picture", Kind.TEXT, "its file in the fleet's folder, errors in colour"),
                *LIGHT,
            ),
        ),
        TableSchema(
            "frames",
            "A row per evaluated frame, variant and stage, in a folder a drive.",
            (
                FRAME,
                _STAMP,
                Column("log_time_ns", Kind.TIME, "when the recorder logged it"),
                *_MASK,
                *COUNTS,
                *LIGHT,
            ),
            streamed=True,
        ),
    )
}
"""The tables by name. A drive's record holds its rows of all but ``frames``, which is a file a
drive."""

RECORDED: Final = tuple(name for name, table in TABLES.items() if not table.streamed)
"""The tables whose rows a drive's record holds."""


def blank(table: str) -> dict[str, None]:
    """Return a row of a table without any value."""
    return dict.fromkeys(TABLES[table].names)
