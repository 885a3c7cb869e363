"""Choices of the statistics over drives, with their reasons."""

from typing import Annotated

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from roadeval.evaluation.drives.sign_flip import MOST


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class AcrossSettings:
    """How drives are summed up. A cluster is a group of drives, or a drive without a group.

    Parameters
    ----------
    confidence
        Of every interval.
    least_clusters
        Clusters that an interval needs. With five, the least two-sided p-value of a sign-flip test
        is 1/16, so none can be found to differ at 95 %.
    exact_below
        With fewer clusters than this the mean's interval is that of the exact sign-flip test,
        from it on Student's, which takes the mean for normal.
    """

    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    least_clusters: Annotated[int, Field(ge=4, le=1_000_000)] = 6
    exact_below: Annotated[int, Field(ge=0, le=MOST + 1)] = 30
