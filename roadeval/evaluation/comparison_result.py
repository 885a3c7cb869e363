"""The content of a comparison: results side by side, mask by mask, and what limits it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference


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
        New minus base by metric; empty where nothing is subtracted.
    """

    result: str
    variant: str
    stage: str
    final: bool
    frames: int
    base: Mapping[str, float]
    new: Mapping[str, float]
    difference: Mapping[str, Difference]

    @property
    def name(self) -> str:
        """The result and its variant, which may be called the same."""
        return self.result if self.result == self.variant else f"{self.result}: {self.variant}"


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
class RegionComparison:
    """The final mask of a variant of a new result within a region, whose ``title`` is for people.

    ``base`` and ``new`` are mean ERR over the ``frames`` on which both have labelled pixels there.
    """

    result: str
    variant: str
    region: str
    title: str
    frames: int
    base: float
    new: float
    difference: Difference


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A frame on which two final masks disagree much.

    ``base_right`` and ``new_right`` are the shares of its labelled pixels that the base's mask, or
    the new one's, alone has right.
    """

    result: str
    variant: str
    frame: int
    stamp_ns: int
    base_right: float
    new_right: float


@dataclass(frozen=True, slots=True)
class FramesLeftOut:
    """Frames that a result evaluated, and that another lacks or trained on."""

    result: str
    other: str
    frames: int


@dataclass(frozen=True, slots=True)
class VariantLeftOut:
    """A variant that two results have, but on no frame both."""

    base: str
    new: str
    variant: str


@dataclass(frozen=True, slots=True)
class SettingsDiffer:
    """Settings that two results were not made with alike: both values by the setting's name."""

    base: str
    new: str
    settings: Mapping[str, tuple[Any, Any]]


@dataclass(frozen=True, slots=True)
class TruthDiffers:
    """Frames whose truth is another in two results, and whether their settings differ, too."""

    base: str
    new: str
    frames: int
    settings_differ: bool


@dataclass(frozen=True, slots=True)
class LogUnknown:
    """A result that does not know which log it is of, so that nothing is subtracted."""

    result: str


@dataclass(frozen=True, slots=True)
class DrivesDiffer:
    """Two results of different drives, so that nothing is subtracted."""

    result: str
    other: str


@dataclass(frozen=True, slots=True)
class EndMissing:
    """A result whose run was stopped: it holds a part of the drive."""

    result: str


Note = (
    FramesLeftOut
    | VariantLeftOut
    | SettingsDiffer
    | TruthDiffers
    | LogUnknown
    | DrivesDiffer
    | EndMissing
)


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
    regions
        The final masks of each new result, region by region.
    moved
        The frames that changed most.
    disagreements
        The frames on which final masks of one run disagree most.
    notes
        What was left out, and what makes the results less comparable than they look.
    settings
        The confidence of the intervals, and what is negligible.
    """

    same_drive: bool
    results: tuple[ComparedResult, ...]
    changes: tuple[MaskComparison, ...]
    levels: tuple[MaskComparison, ...]
    moved: tuple[MovedFrame, ...]
    notes: tuple[Note, ...]
    settings: EvaluationSettings
    regions: tuple[RegionComparison, ...] = ()
    disagreements: tuple[Disagreement, ...] = ()
