"""Every choice of the evaluation that is not fixed by the paper, with its reason."""

from itertools import pairwise
from typing import Annotated, Final

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

FAILED_ERR: Final = 0.25
"""A frame with at least this ERR has failed: a quarter of its pixels are wrong."""
FAILED_FNR: Final = 0.9
"""A frame with at least this FNR has failed, even if it has little road: almost no road was found.
"""
DEGRADED_ERR: Final = 0.15
"""A frame with at least this ERR is degraded. The ``blind`` baseline reaches about half of it on an
ordinary street."""
DEGRADED_MARGIN: Final = 0.02
"""A frame is degraded too if its ERR exceeds the ERR of ``blind`` by more than this: ignoring the
image would have been better."""
NOTEWORTHY: Final = 0.05
"""Least change of ERR by the filter, or excess of ERR over ``blind``, that is reported."""
MOST_CELLS: Final = 4_000_000
"""Greatest number of cells in the view of the ground from above, which limits the memory."""
Metres = Annotated[int, Field(ge=0, le=500)]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class EvaluationSettings:
    """How results are counted, summed up and judged. Rates are fractions.

    window: Evaluated frames in a row of ``windows.csv``; the paper uses 10 (section 5).
    boundary_width: Pixels on either side of the truth's edge that make up the region ``boundary``.
        Annotators place an edge with a few pixels of freedom, so errors there mean less.
    bands: Equal stripes of image rows, ``band_0`` at the top; they show how far away errors are.
    confidence: Confidence of the interval around a difference.
    least_frames: Frames that an interval needs. Fewer hardly show how much
        neighbouring frames resemble each other.
    distances: Limits of the distance bands, in metres ahead; they need a known camera.
    edges_at: Metres ahead at which the road's left and right edges are measured.
    plan: Nearest and farthest metres ahead in the view from above, as in KITTI's benchmark.
    plan_width: Width of that view in metres; road edges outside it are not searched.
    plan_cell: Side of the square cells of that view in metres; each cell counts once.
    """

    window: Annotated[int, Field(ge=1, le=1_000_000_000)] = 10
    boundary_width: Annotated[int, Field(ge=1, le=100)] = 5
    bands: Annotated[int, Field(ge=1, le=50)] = 5
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    least_frames: Annotated[int, Field(ge=4, le=1_000_000_000)] = 10
    distances: Annotated[tuple[Metres, ...], Field(min_length=2, max_length=20)] = (
        0,
        10,
        20,
        40,
        80,
    )
    edges_at: Annotated[tuple[Metres, ...], Field(max_length=20)] = (5, 10, 20, 40)
    plan: tuple[Metres, Metres] = (6, 46)
    plan_width: Annotated[float, Field(gt=0, le=200)] = 20.0
    plan_cell: Annotated[float, Field(ge=0.01, le=1)] = 0.05

    def __post_init__(self) -> None:
        for name in ("distances", "plan"):
            steps = getattr(self, name)
            if any(far <= near for near, far in pairwise(steps)):
                raise ValueError(f"{name} must rise from number to number")
        cells = (self.plan[1] - self.plan[0]) * self.plan_width / self.plan_cell**2
        if cells > MOST_CELLS:
            problem = f"plan has {cells:,.0f} cells, more than {MOST_CELLS:,}"
            raise ValueError(f"{problem}; enlarge plan_cell")
