"""Settings of a run's outputs and of its execution, and the tables that hold for a whole run."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

SECTIONS: Final = ("topics", "labels", "frames", "training", "evaluation", "output", "run")
"""The tables that hold for the whole run, by the names of the fields of
`roadeval.config.RunConfig`."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class OutputSettings:
    """Where the results of a run are written, and which pictures are recorded.

    Parameters
    ----------
    save
        The recording; ``recordings/<drive>.rrd`` by default.
    reports
        The folder of tables and figures; ``reports/<drive>/`` by default.
    mcap
        A log of masks, error maps and rates, to open beside the drive; none by default.
    record
        Whose pictures are recorded: ``all``; ``masks`` and labels, with the camera's image; all
        pictures of the ``worst:K`` frames by ERR, or of ``every:N``-th frame; ``none``, which
        means no recording.
    """

    save: str | None = None
    reports: str | None = None
    mcap: str | None = None
    record: str = "all"


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ExecutionSettings:
    """How a run is executed; changes no number.

    Parameters
    ----------
    jobs
        Worker threads; one per CPU core by default.
    """

    jobs: Annotated[int, Field(ge=1, le=1000)] | None = None
