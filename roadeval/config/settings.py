"""Settings of a run's outputs and of its execution, and the tables that hold for a whole run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal

from annotated_types import Interval

from roadeval.runtime.settings import Flag

SECTIONS: Final = (
    *("topics", "truth", "labels", "frames", "ground", "training", "evaluation", "output"),
    *("run", "fleet"),
)
"""The tables that hold for the whole run, by the names of the fields of
`roadeval.config.run.RunConfig`."""


@dataclass(frozen=True)
class OutputSettings:
    """Where the results of a run are written, and which images are recorded."""

    save: Annotated[str | None, Flag("--save", "OUT.rrd")] = None
    """The recording. Default: ``recordings/<drive>.rrd``."""
    reports: Annotated[str | None, Flag("-o --reports", "DIR")] = None
    """The folder of tables and figures. Default: ``reports/<drive>/``, or, of a
    recording ``--save new.rrd``, ``reports/new/``."""
    mcap: Annotated[str | None, Flag("--mcap", "OUT.mcap")] = None
    """Masks, error maps and rates as a log, to open beside the drive. Default: none."""
    record: Annotated[str, Flag("--record", "WHAT")] = "all"
    """Whose pictures are recorded: ``all``, ``masks``, ``worst:K``, ``every:N`` or ``none``. With
    ``masks`` go labels and the camera's image; of the ``worst:K`` frames by ERR, in a
    log without truth by how much the mask is in doubt, and of ``every:N``-th frame, all pictures
    are recorded; ``none`` means no recording."""
    figures: bool = True
    """Whether the paper's figures are drawn; a fleet does not draw those of its drives."""


@dataclass(frozen=True)
class ExecutionSettings:
    """How a run is executed; changes no number."""

    jobs: Annotated[int | None, Interval(ge=1, le=1000), Flag("--jobs", "N")] = None
    """Worker threads; processes of a fleet. Default: one per CPU core."""
    patience_s: Annotated[float, Interval(ge=1, le=3600), Flag("--patience", "SECONDS")] = 20.0
    """Seconds for which a server that holds a log may be silent before the run ends."""


@dataclass(frozen=True)
class FleetSettings:
    """How a fleet of drives is replayed; means nothing to a single drive."""

    folds: Annotated[int | None, Interval(ge=2, le=1000), Flag("--folds", "K")] = None
    """Score each drive by a model of others: deal drives, or their groups, into K folds. Each fold
    is scored by a model that learnt from the others. Copies of one log are of one group. Without
    folds ``training.model`` scores all, or each drive trains its own."""
    keep: Annotated[Literal["all", "none"], Flag("--keep", "WHAT")] = "none"
    """Whether every drive is recorded: ``all``, or ``none``."""
    scheduler: Annotated[str | None, Flag("--scheduler", "ADDRESS")] = None
    """A Dask scheduler, as ``tcp://host:8786``, or its file: its workers replay the drives."""
