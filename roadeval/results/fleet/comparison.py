"""A comparison of two fleets for people and machines: its JSON content, and its sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import percent, plain_points
from roadeval.evaluation.comparison_result import SettingsDiffer
from roadeval.evaluation.drives_comparison_result import (
    FALSE,
    TESTED,
    DriveChange,
    FleetChange,
    FleetStratum,
    Mask,
)
from roadeval.evaluation.drives_conditions import FleetJudgement
from roadeval.evaluation.drives_matching import LeftOut, LeftOutBecause
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.comparison import note
from roadeval.results.fleet.verdict import sentence
from roadeval.results.schema import TAG

FORMAT: Final = {"name": "roadeval-fleet-comparison", "version": 1}
NAMED: Final = 5
"""Drives of those left out for one reason, which are named."""


@dataclass(frozen=True, slots=True)
class FleetSide:
    """One of two fleets: its label, its drives, and how many of them were scored."""

    label: str
    drives: int
    scored: int
    version: str


@dataclass(frozen=True, slots=True)
class FleetComparison:
    """Two fleets, compared drive by drive.

    Parameters
    ----------
    base, new
        The fleets.
    drives, by_log
        Drives that both have scored; how many of them are the same by their log alone.
    changes
        Each mask that both have, over drives.
    strata
        The changes of the final masks by tags.
    drive_changes
        The changes of ERR of single drives, mask by mask, the surest first.
    left_out
        Drives that are not compared.
    untested
        Final masks whose single drives were not tested, for time.
    frames_left_out
        Frames that only the base, and only the new fleet, has evaluated of common drives.
    truths_differ
        Drives whose truth is another in both.
    settings_differ
        Settings that the fleets were not made with alike; None where there are none.
    names
        The drives' names for people, by their identity.
    settings
        The confidence, and what is negligible.
    """

    base: FleetSide
    new: FleetSide
    drives: int
    by_log: int
    changes: tuple[FleetChange, ...]
    strata: tuple[FleetStratum, ...]
    drive_changes: tuple[DriveChange, ...]
    left_out: tuple[LeftOut, ...]
    untested: tuple[Mask, ...]
    frames_left_out: tuple[int, int]
    truths_differ: int
    settings_differ: SettingsDiffer | None
    names: Mapping[str, str]
    settings: EvaluationSettings

    def finals(self) -> list[FleetChange]:
        """Return the changes of final masks; the baseline's tells nothing of a method."""
        finals = [change for change in self.changes if change.final]
        return [change for change in finals if change.variant != BASELINE] or finals

    def changed(self, mask: Mask) -> list[DriveChange]:
        """Return the drives on which a mask changed, the surest first."""
        own = (row for row in self.drive_changes if (row.variant, row.stage) == mask)
        return [row for row in own if row.changed]


def as_dict(
    comparison: FleetComparison, judgements: Sequence[FleetJudgement] = ()
) -> dict[str, Any]:
    """Return the content of a comparison's JSON file: its facts, and the sentences on them."""
    return {
        "format": FORMAT,
        "verdict": verdict(comparison),
        "fleets": [asdict(comparison.base), asdict(comparison.new)],
        "drives": comparison.drives,
        "drives_by_log": comparison.by_log,
        "changes": [asdict(change) for change in comparison.changes],
        "strata": [_stratum(each) for each in comparison.strata],
        "false_discovery_rate": FALSE,
        "drive_changes": [
            {"name": comparison.names[row.drive], **asdict(row), "changed": row.changed}
            for row in comparison.drive_changes
        ],
        "left_out": [
            {"name": comparison.names[each.drive], **asdict(each)} for each in comparison.left_out
        ],
        "warnings": warnings(comparison),
        "conditions": [
            {**asdict(each), **asdict(each.condition), "sentence": judged(each, comparison)}
            for each in judgements
        ],
        "settings": asdict(comparison.settings),
    }


def verdict(comparison: FleetComparison) -> str:
    """Return whether the new fleet is better or worse than the base, and how sure that is."""
    return " ".join(_verdicts(comparison))


def _verdicts(comparison: FleetComparison) -> Iterator[str]:
    what = f"{comparison.new.label} instead of {comparison.base.label}"
    finals = comparison.finals()
    for change in finals:
        found = asdict(change.difference[TESTED])
        about: dict[str, Any] = {"stage": change.stage, "metric": TESTED}
        if change.p_holm is not None:
            about["p"] = change.p_holm
        told = sentence(found | about, what, comparison.settings)
        yield f"{change.variant}: {told[0].lower()}{told[1:]}" if len(finals) > 1 else told


def changed_drives(comparison: FleetComparison, mask: Mask) -> str:
    """Return how many single drives changed, and in which direction."""
    rows = comparison.changed(mask)
    tested = sum(
        row.q is not None for row in comparison.drive_changes if (row.variant, row.stage) == mask
    )
    if not tested:
        return f"{mask[0]}: no single drive was tested."
    worse = sum(row.mean > 0 for row in rows)
    return (
        f"{mask[0]}: ERR of {mask[1]} changed on {len(rows)} of {tested} drives: worse on {worse}, "
        f"better on {len(rows) - worse}."
    )


def discovery_note() -> str:
    """Return what it means that a drive is named as changed."""
    return (
        f"Of the drives that are called changed, at most {percent(FALSE, 0)} % on average are not "
        "(Benjamini and Hochberg's correction over the drives; q is the p-value after it)."
    )


def warnings(comparison: FleetComparison) -> list[str]:
    """Return what was left out and what makes the fleets less comparable than they look."""
    return list(_warnings(comparison))


def _warnings(comparison: FleetComparison) -> Iterator[str]:
    labels = {"base": comparison.base.label, "new": comparison.new.label}
    if comparison.by_log:
        yield (
            f"{comparison.by_log} drives go by other paths in both fleets and are taken for the "
            "same by the SHA-256 of their logs"
        )
    groups = dict.fromkeys((each.fleet, each.because) for each in comparison.left_out)
    for fleet, because in groups:
        own = [e.drive for e in comparison.left_out if (e.fleet, e.because) == (fleet, because)]
        yield _left_out([comparison.names[drive] for drive in own], labels, fleet, because)
    for place, (label, other) in enumerate((labels.values(), reversed(labels.values()))):
        if frames := comparison.frames_left_out[place]:
            yield (
                f"{frames} frames that {label} evaluated are left out, which {other} lacks or "
                "trained on"
            )
    if comparison.settings_differ:
        yield note(comparison.settings_differ)
    if comparison.truths_differ:
        yield (
            f"the truth differs on {comparison.truths_differ} drives: part of their change may be "
            "the truth's"
        )
    if comparison.untested:
        yield (
            f"for time, single drives were not tested for {_masks(comparison.untested)}; the "
            "change over drives needs no such test"
        )


def _left_out(
    names: Sequence[str], labels: Mapping[str, str], fleet: str, because: LeftOutBecause
) -> str:
    label, other = labels[fleet], labels["new" if fleet == "base" else "base"]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    count = f"{len(names)} drive{'' if len(names) == 1 else 's'}"
    reason = {
        LeftOutBecause.ONLY_THERE: f"of {label} are left out, for {other} does not have them",
        LeftOutBecause.NOT_SCORED: f"of {label} are left out, for they are not scored in both",
        LeftOutBecause.OTHER_LOG: (
            f"of {label} are left out, for their logs are others than those of {other}"
        ),
        LeftOutBecause.NO_FRAME: (
            f"of {label} are left out, for {other} has evaluated none of the same frames"
        ),
    }[because]
    return f"{count} {reason}: {', '.join(names[:NAMED])}{more}"


def _masks(masks: Sequence[Mask]) -> str:
    return ", ".join(f"{stage}.{variant}" for variant, stage in masks)


def judged(judgement: FleetJudgement, comparison: FleetComparison) -> str:
    """Return what was found of a condition, and whether it holds."""
    condition, drives = judgement.condition, judgement.drives
    rate = f"{condition.stage}.{condition.variant}.{condition.rate} of {comparison.new.label}"
    holds = "holds" if judgement.holds else "does not hold"
    over = f"over {drives} drive{'' if drives == 1 else 's'}"
    after = f"{percent(judgement.after)} %"
    if not condition.is_change:
        return f"{rate} is {after} {over}: {condition.text} {holds}"
    change = f"{plain_points(judgement.change)} pp"
    if condition.surely:
        change += f" [{plain_points(judgement.low)}, {plain_points(judgement.high)}]"
    before = f"{percent(judgement.before)} %"
    return f"{rate} changed by {change} {over} ({before} to {after}): {condition.text} {holds}"


def _stratum(each: FleetStratum) -> dict[str, Any]:
    own = asdict(each.stratum)
    across = own.pop("across")
    own |= {"by": f"{TAG}{own['by']}", "value": str(own["value"])}
    return {"variant": each.variant, "stage": each.stage, "metric": TESTED, **own, **across}
