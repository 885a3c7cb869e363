"""The tables of results: one schema for a drive, a rig and a fleet.

Header, lines, types, the recording's headers and the documentation follow from here. Every row
begins with its drive and camera, so that the tables of many drives are those of one, joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Final, NamedTuple

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


TYPES: Final = dict(
    zip(Kind, ("str", "str", "int64", "int64", "float64", "float64", "bool"), strict=True)
)
"""The type of each kind, as NumPy and Arrow call it."""


class Column(NamedTuple):
    """A column of a table, with one line of documentation."""

    name: str
    kind: Kind
    doc: str

    @property
    def is_word(self) -> bool:
        """Whether it holds names or text."""
        return self.kind in (Kind.NAME, Kind.TEXT)


LATER: Final = ("truth",)
"""Columns that the first results of this format lack: they hold 0 then, for unknown."""


class TableSchema(NamedTuple):
    """A table: ``<name>.csv`` in the results of a drive, ``<name>.parquet`` in those of a fleet."""

    name: str
    doc: str
    """Describes a row."""
    columns: tuple[Column, ...]
    """In the file's order."""

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return tuple(column.name for column in self.columns)

    @property
    def of_a_fleet(self) -> tuple[Column, ...]:
        """Further columns in the file of a fleet."""
        return _columns(_FINAL) if self.name == "frames" else ()

    @property
    def header(self) -> str:
        """The first line of the CSV file."""
        return ",".join(self.names) + "\n"

    def arrow(self) -> pa.Schema:
        """Return the columns with their Arrow types, those of a fleet included."""
        import pyarrow as pa

        return pa.schema([(c.name, TYPES[c.kind]) for c in (*self.columns, *self.of_a_fleet)])


def _columns(text: str) -> tuple[Column, ...]:
    """Return the columns that a text describes, a line each: name, kind and meaning."""
    lines = (line.split(maxsplit=2) for line in text.strip().splitlines())
    return tuple(Column(name, Kind(kind), doc) for name, kind, doc in lines)


def _tables(text: str) -> tuple[TableSchema, ...]:
    """Return the tables of a text: of each its name, what a row is, and a line a column."""
    parts = (part.split("\n", 1) for part in text.strip().split("\n\n"))
    named = ((*head.split(": ", 1), columns) for head, columns in parts)
    return tuple(TableSchema(name, doc, _columns(columns)) for name, doc, columns in named)


SCORED: Final = "scored"
DAMAGED: Final = "damaged"
UNSCORED: Final = "unscored"
FAILED: Final = "failed"
"""The values of ``status`` in ``drives``."""
TAG: Final = "tag_"
"""Begins the name of a column of ``drives`` that holds a tag."""

_KEY: Final = """\
drive        text   the log's name; in a fleet, its own name there
camera       text   the image topic"""
KEY: Final = _columns(_KEY)
"""The first columns of every table."""
_IN_FRAME: Final = f"{_KEY}\nframe count position in the image topic by log time, from 0"
_STAMP: Final = "stamp_ns time   header stamp"
_VARIANT: Final = "variant  name   whose mask; `blind` is the baseline"
_STAGE: Final = "stage    name   after which stage of the chain"
_MASK: Final = f"{_VARIANT}\n{_STAGE}"
_FINAL: Final = "final    flag   whether that is the variant's last stage"
_LABELLED: Final = "N        count  labelled pixels"
_COUNTS: Final = f"""\
TP           count  road classified as road, in pixels
TN           count  non-road classified as non-road
FP           count  non-road classified as road
FN           count  road classified as non-road
{_LABELLED}"""
_RATES: Final = {
    name: f"{name} rate {metric.title}, {metric.formula} ({metric.unit})"
    for name, metric in METRICS.items()
}
_EACH_RATE: Final = "\n".join(_RATES.values())
_DOUBTS: Final = "\n".join(f"{sign} rate {words}" for sign, words in SIGNS.items())
_MEANS: Final = "\n".join(
    [
        *(f"{name} rate mean of the frames' {name}" for name in METRICS),
        *(f"pooled_{name} rate {name} of the summed counts" for name in METRICS),
    ]
)
_MEASURE: Final = """\
measure      name   `left_edge`, `right_edge`, `free_distance`, a rate
where        name   as `10m`, `ahead`, `0-10m`, `from_above`"""
"""Measures of a camera that is known: metres to the left, or ahead, on flat ground."""

_OF_FRAMES: Final = _tables(f"""
frames: A row per evaluated frame, variant and stage; in a fleet, in a folder per drive.
{_IN_FRAME}
{_STAMP}
log_time_ns  time   when the recorder logged it
{_MASK}
{_COUNTS}
{_EACH_RATE}
truth        count  checksum of the truth's pixels, of all masks of the frame

regions: A row per evaluated frame, variant, stage and region.
{_IN_FRAME}
{_MASK}
region       name   the pixels that are counted
{_COUNTS}

oracles: A row per evaluated frame, variant, stage replaced by the truth, and stage after it.
{_IN_FRAME}
{_VARIANT}
oracle       name   the stage that is replaced
{_STAGE}
{_COUNTS}
{_EACH_RATE}

disagreements: A row per evaluated frame and pair of final masks.
{_IN_FRAME}
from_variant name   the first mask's
to_variant   name   the second mask's
repaired     count  pixels that only the second mask has right
spoiled      count  pixels that only the first mask has right
{_LABELLED}

unlabelled: A row per frame without truth and variant: how doubtful its mask is, not how wrong.
{_IN_FRAME}
{_STAMP}
{_MASK}
{_DOUBTS}

edges: A row per evaluated frame, final mask and place where the road ends, in metres.
{_IN_FRAME}
{_MASK}
{_MEASURE}
mask_m       number where the mask's road ends; empty if it does not
truth_m      number where the truth's does
""")
_OF_SUMS: Final = _tables(f"""
windows: A row per window of consecutive evaluated frames, variant and stage.
{_KEY}
window       count  from 0
first_frame  count  number of its first frame
last_frame   count  number of its last frame, inclusive
frames       count  evaluated frames that have this mask
{_MASK}
{_MEANS}

changes: A row per mask and the one before it: stage to stage, and final mask to final mask.
{_KEY}
from_variant name   the mask before: its variant
from_stage   name   and its stage
to_variant   name   the mask after: its variant
to_stage     name   and its stage
repaired     count  pixels of the drive that are wrong before only
spoiled      count  pixels of the drive that are wrong after only
{_LABELLED}

heat: A row per variant and square cell of the image: where the final mask errs.
{_KEY}
{_VARIANT}
top          count  first row of the cell, in pixels
left         count  first column of the cell
side         count  of the cell, in pixels
labelled     count  how often a pixel of it was labelled
FP           count  how often one was a false positive
FN           count  how often one was a false negative

probabilities: A row per variant, stage and level of its road probability, for curves.
{_KEY}
{_MASK}
level        count  0 to 255, equally wide, from improbable to certain
road         count  labelled road pixels of the drive at this level
other        count  labelled non-road pixels

metres: A row per final mask and measure on the ground; see the how-to on metres.
{_KEY}
{_VARIANT}
{_MEASURE}
frames       count  evaluated frames on which the truth has it; 0 of a sum
missing      count  of these, frames on which the mask has not
value        number median of mask minus truth, outwards or ahead; or rate
p95          number 95th percentile of the size of the difference
low          number least value as the camera might stand
high         number greatest value as it might stand
""")
_OF_DRIVES: Final = _tables(f"""
drives: A row per drive and camera, scored or not; a column `tag_<key>` for each tag.
{_KEY}
name         text   of its log, for people; two may have the same
source       text   path or URL of the log
group        text   drives of one day or route share one
fold         count  the fold whose model scored it; empty without folds
status       name   scored, damaged (scored but for what is lost), unscored (no truth), failed
exit_code    count  that `replay` of this drive alone ends with
reason       text   why it was not scored
seconds      number that the last attempt took
log_digest   name   tells the log from another: of its index and checksums
start_ns     time   header stamp of the first evaluated frame
end_ns       time   of the last one
rate_hz      number of the camera
width        count  of the frames, in pixels
height       count  of the frames, in pixels
in_log       count  frames of the camera's topic
read         count  frames that were read
decoded      count  frames that could be decoded
labelled     count  frames that have a truth
trained_on   count  frames left out because a model learnt from them
evaluated    count  frames that were scored
losses       text   what was lost of the log, a sentence a line
warnings     text   warnings, a sentence a line
misfits      text   truth or masks that do not fit the images, a sentence a line
verdict      text   the verdict on this drive alone
model        name   SHA-256 of the model file; empty if it trained its own

scores: A row per drive, camera, variant, stage and region.
{_KEY}
{_MASK}
{_FINAL}
region       name   the pixels that are counted; `all` is every one
frames       count  evaluated frames that have this mask and region
{_COUNTS}
{_MEANS}
boundary_f   rate   mean boundary F of the final mask
boundary_iou rate   mean boundary IoU of the final mask
episodes     count  stretches of frames with an ERR of 15 % or more
episode_seconds number how long these are, in all
flicker      rate   share of pixels that change from frame to frame
truth_flicker rate  the same of the truth

effects: A row per drive, camera, difference between two masks, and rate.
{_KEY}
base         name   the variant that is subtracted: `unfiltered` or `blind`
{_MASK}
{_FINAL}
metric       name   the rate
mean         rate   of the frames' differences
standard_error number of that, as frames of a drive are alike
low          rate   lower end of its interval
high         rate   upper end
p            rate   p-value of no difference
frames       count  frames that have a difference
effective_frames number independent frames that tell as much
worse        count  frames on which it is worse than the base
better       count  frames on which it is better

worst: A row per frame among the worst of all, by ERR of the first variant's final mask.
rank         count  1 is the worst
{_IN_FRAME}
{_STAMP}
{_MASK}
{_RATES["ERR"]}
{_RATES["FNR"]}
{_RATES["FPR"]}
picture      text   its file in the fleet's folder, errors in colour
""")

TABLES: Final[Mapping[str, TableSchema]] = {
    table.name: table for table in (*_OF_FRAMES, *_OF_SUMS, *_OF_DRIVES)
}
"""Every table by its name."""
STREAMED: Final = tuple(table.name for table in _OF_FRAMES)
"""The tables whose rows come with each frame; the others of a drive are sums over it."""
OF_A_DRIVE: Final = tuple(table.name for table in (*_OF_FRAMES, *_OF_SUMS))
"""The tables of one drive, in the order in which they are written."""
OF_DRIVES: Final = tuple(table.name for table in _OF_DRIVES)
"""The tables of a fleet beside ``frames``: each drive's rows are kept in its record."""


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
