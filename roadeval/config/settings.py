"""Settings of a run's outputs and of its execution, and the tables that hold for a whole run."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

SECTIONS: Final = (
    *("topics", "labels", "frames", "training", "evaluation", "output", "run", "fleet"),
)
"""The tables that hold for the whole run, by the names of the fields of
`roadeval.config.RunConfig`."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class OutputSettings:
    """Where the results of a run are written, and which pictures are recorded."""

    save: str | None = None
    """The recording; ``recordings/<drive>.rrd`` by default."""
    reports: str | None = None
    """The folder of tables and figures; ``reports/<drive>/`` by default."""
    mcap: str | None = None
    """A log of masks, error maps and rates, to open beside the drive; none by default."""
    record: str = "all"
    """Whose pictures are recorded: ``all``; ``masks`` and labels, with the camera's image; all
    pictures of the ``worst:K`` frames by ERR, or of ``every:N``-th frame; ``none``, which means
    no recording."""
    figures: bool = True
    """Whether the paper's figures are drawn; a fleet does not draw those of its drives."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ExecutionSettings:
    """How a run is executed; changes no number."""

    jobs: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Worker threads; one per CPU core by default."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class FleetSettings:
    """How a fleet of drives is replayed; means nothing to a single drive."""

    folds: Annotated[int, Field(ge=2, le=1000)] | None = None
    """Deal the drives, or their groups, into so many folds: each is scored by a model that learnt
    from the other folds. Copies of one log are of one group. None: ``training.model`` scores
    all, or each drive trains its own."""
    training_drives: Annotated[int, Field(ge=1, le=10_000)] = 20
    """Drives that the model of a fold learns from, at most; drawn by ``training.seed``, groups in
    turn. Their training frames are held decoded."""
    keep: Annotated[str, Field(pattern=r"^(all|none|worst:[1-9]\d{0,5})$")] = "none"
    """Whose recordings stay: ``all``; those of the ``worst:N`` drives by ERR; ``none``, which means
    that none is made."""
    workers: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Processes that replay drives; one a processor by default."""
    memory_gib: Annotated[float, Field(gt=0, le=100_000)] | None = None
    """What each of them may take; by default its share of the machine's."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers replay the drives, or the file that it has written;
    by default processes of this machine do."""
    max_failures: Annotated[str, Field(pattern=r"^(\d{1,9}|\d{1,2}(\.\d+)?%|100%)$")] | None = None
    """Drives that may fail, as ``3`` or ``10%``, without the fleet having failed."""
