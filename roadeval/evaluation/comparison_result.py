"""The content of a comparison: results side by side, mask by mask, and judged limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from roadeval.evaluation.uncertainty import Difference

FORMAT: Final = {"name": "roadeval-comparison", "version": 1}


@dataclass(frozen=True, slots=True)
class ComparedResult:
    """One of the results: its label, the log's name and SHA-256, its evaluated frames and scale.

    ``sha256`` and ``scale`` are None where the result does not know them.
    """

    label: str
    drive: str
    sha256: str | None
    frames: int
    scale: float | None


@dataclass(frozen=True, slots=True)
class MaskComparison:
    """One stage of one variant of a new result.

    Parameters
    ----------
    result
        Label of the new result.
    variant, stage
        Whose mask.
    final
        Whether it is the variant's final mask.
    frames
        Frames that are summed up.
    base, new
        Mean and pooled metrics and those of the overlap by name; ``base`` is empty where nothing is
        subtracted.
    difference
        New minus base by metric: of the final mask several, of others the first alone.
    """

    result: str
    variant: str
    stage: str
    final: bool
    frames: int
    base: Mapping[str, float]
    new: Mapping[str, float]
    difference: Mapping[str, Difference]


@dataclass(frozen=True, slots=True)
class MovedFrame:
    """A frame whose final ERR changed much: that of the base and of the new result."""

    result: str
    variant: str
    frame: int
    stamp_ns: int
    base: float
    new: float
    change: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """Results compared with the first of them.

    Parameters
    ----------
    same_drive
        Whether all are of one log. If not, nothing is subtracted: ``changes`` are ``levels``.
    results
        The base first.
    changes
        Each mask of each new result, on the frames that both evaluated.
    levels
        The same on all of its own frames, whatever the base lacks; of different drives those of
        every result.
    moved
        The frames that changed most.
    warnings
        What was left out, and what makes the results less comparable than they look.
    """

    same_drive: bool
    results: tuple[ComparedResult, ...]
    changes: tuple[MaskComparison, ...]
    levels: tuple[MaskComparison, ...]
    moved: tuple[MovedFrame, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Judgement:
    """A condition that was judged: its text, whether it holds, and why in a sentence."""

    text: str
    holds: bool
    sentence: str


def as_dict(comparison: Comparison, judgements: tuple[Judgement, ...] = ()) -> dict[str, Any]:
    """Return the content of a comparison's JSON file."""
    conditions = [asdict(judgement) for judgement in judgements]
    return {"format": FORMAT, **asdict(comparison), "conditions": conditions}
