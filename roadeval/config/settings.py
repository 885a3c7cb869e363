"""Settings of a run's outputs and of its execution, and the names of a run's tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal

from annotated_types import Interval

from roadeval.runtime.settings import Checked, Flag

SECTIONS: Final = (
    *("topics", "truth", "labels", "frames", "ground", "training", "evaluation", "output"),
    *("run", "fleet"),
)
"""The tables that apply to all variants; `roadeval.config.run.RunConfig` has fields of their names.
"""


def _labels(labels: object) -> object:
    """Return labels of results; a ValueError for a bad name or a value that is not a short line."""
    from roadeval.data import is_plain

    for name, text in labels.items() if isinstance(labels, Mapping) else ():
        if not is_plain(name) or not 0 < len(str(text)) <= 500 or not str(text).isprintable():
            raise ValueError("must be NAME=VALUE: letters, digits, - and _, then up to 500 letters")
    return labels


def _spare(tables: object) -> object:
    """Return names of tables to leave out; a ValueError for one that results need."""
    from roadeval.results.schema import OF_A_DRIVE

    spare = [name for name in OF_A_DRIVE if name not in ("frames", "windows")]
    if not isinstance(tables, list | tuple):
        return tables
    if not {*map(str, tables)} <= {*spare}:
        raise ValueError(f"must be some of {', '.join(spare)}")
    return tuple(tables)


@dataclass(frozen=True)
class OutputSettings:
    """Where the results of a run are written, and which images are recorded.

    save: File of the recording. Default: ``recordings/<drive>.rrd``.
    reports: Folder of tables and figures. Default: ``reports/<recording>/``.
    mcap: Log of masks, error maps and rates, to open beside the drive. Default: none.
    record: Pictures to record: ``all``, ``masks``, ``worst:K``, ``every:N`` or ``none``. ``masks``
        also records labels and the camera's image. ``worst:K`` records all pictures of the K frames
        with the highest ERR, or with the most uncertain masks if there is no truth; ``every:N``
        records all pictures of every N-th frame. ``none`` makes no recording.
    focus: Variant that the results are about: verdict, worst frames, thumbnails. Default: the first
        that you add, else ``filtered``.
    labels: Label of the results, such as branch=main; it changes no number.
    figures: Whether the paper's figures are drawn; a fleet draws none for its drives.
    packed: Whether tables are compressed, as ``frames.csv.gz``. A fleet always compresses the
        tables of its drives.
    without: Tables to leave out, such as ``heat`` or ``regions``; a report then lacks them too.
    """

    save: Annotated[str | None, Flag("--save", "OUT.rrd")] = None
    reports: Annotated[str | None, Flag("-o --output --reports", "DIR")] = None
    mcap: Annotated[str | None, Flag("--mcap", "OUT.mcap")] = None
    record: Annotated[str, Flag("--record", "WHAT")] = "all"
    focus: Annotated[str | None, Flag("--focus", "NAME", "Methods")] = None
    labels: Annotated[Mapping[str, str], Checked(_labels), Flag("--label", "NAME=VALUE")] = field(
        default_factory=dict
    )
    figures: bool = True
    packed: bool = False
    without: Annotated[tuple[str, ...], Checked(_spare)] = ()


@dataclass(frozen=True)
class ExecutionSettings:
    """How a run is executed, which changes no result.

    jobs: Worker threads, or processes of a fleet. Default: one per CPU core.
    patience_s: Seconds that a server with a log may be silent before the run ends.
    """

    jobs: Annotated[int | None, Interval(ge=1, le=1000), Flag("--jobs", "N")] = None
    patience_s: Annotated[float, Interval(ge=1, le=3600), Flag("--patience", "SECONDS")] = 20.0


@dataclass(frozen=True)
class FleetSettings:
    """How a fleet of drives is replayed; a single drive ignores it.

    folds: Number of folds into which drives, or their groups, are divided. Each fold is scored by a
        model that learnt from the other folds. Copies of one log are in one group. Without folds
        ``training.model`` scores all drives, or each drive trains its own model.
    keep: Recordings to keep: of ``all`` drives, or ``none``.
    scheduler: Dask scheduler with the workers that replay drives: ``tcp://host:8786``, or a file.
    """

    folds: Annotated[int | None, Interval(ge=2, le=1000), Flag("--folds", "K")] = None
    keep: Annotated[Literal["all", "none"], Flag("--keep", "WHAT")] = "none"
    scheduler: Annotated[str | None, Flag("--scheduler", "ADDRESS")] = None
