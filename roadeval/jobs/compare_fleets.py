"""Two fleets side by side: from their folders to a comparison over drives and its files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from roadeval.data import BASELINE, Counts
from roadeval.data.counts import OUTCOMES
from roadeval.errors import RoadevalError
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison import ComparisonError
from roadeval.evaluation.comparison_result import SettingsDiffer
from roadeval.evaluation.conditions import Condition
from roadeval.evaluation.drives import AcrossSettings
from roadeval.evaluation.drives_comparison import (
    change_strata,
    changed_drives,
    compare_drives,
    pair_drive,
)
from roadeval.evaluation.drives_comparison_result import DrivePair, Mask
from roadeval.evaluation.drives_conditions import FleetJudgement, FleetLevel, judge_over_drives
from roadeval.evaluation.drives_matching import (
    FleetDrive,
    LeftOut,
    LeftOutBecause,
    Matched,
    match_drives,
)
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.settings import EvaluationSettings, settings_of
from roadeval.jobs.compare import asked, labels_of
from roadeval.report.fleet.comparison import document, markdown
from roadeval.report.page.render import page
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.fleet.comparison import FleetComparison, FleetSide, as_dict, judged
from roadeval.results.fleet.folder import Fleet
from roadeval.results.fleet.masks import read_masks
from roadeval.results.fleet.record import DAMAGED, SCORED
from roadeval.results.schema import ALL
from roadeval.results.summary import json_text, plain

TESTS: Final = 6_000
"""Single drives that are tested, at most: one takes some four milliseconds."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparedFleets:
    """A comparison of two fleets with its judged conditions."""

    comparison: FleetComparison
    judgements: tuple[FleetJudgement, ...]

    @property
    def content(self) -> dict[str, Any]:
        """The content of the JSON file."""
        return as_dict(self.comparison, self.judgements)

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold."""
        return [judged(each, self.comparison) for each in self.judgements if each.holds]


def compare_fleets(
    base: str | Path,
    new: str | Path,
    *,
    variants: Sequence[str] | None = None,
    fail_if: Sequence[str] = (),
) -> ComparedFleets:
    """Compare two fleets, drive by drive.

    Parameters
    ----------
    base, new
        Their folders.
    variants
        Only these.
    fail_if
        Conditions, see `roadeval.evaluation.drives_conditions`.

    Raises
    ------
    RoadevalError
        If a fleet cannot be read, or there is nothing to compare, or a condition not to be judged.
    """
    conditions = [Condition.parse(text) for text in fail_if]
    fleets = Fleet(base), Fleet(new)
    sides = _sides(fleets)
    settings = settings_of(fleets[0].summary)
    matched = match_drives(_drives(fleets[0]), _drives(fleets[1]))
    finals, levels = _levels(fleets[1], variants)
    tested, untested = _tested(finals, len(matched.pairs))
    every = list(_pairs(fleets, matched, variants, tested, settings))
    pairs = [pair for pair in every if pair.masks]
    without = [LeftOut(p.drive, "new", LeftOutBecause.NO_FRAME) for p in every if not p.masks]
    if not pairs:
        raise ComparisonError(
            f"{sides[0].label} and {sides[1].label} have no evaluated frame of one drive in "
            "common, so nothing can be compared; replay the same drives into both"
        )
    across = AcrossSettings(confidence=settings.confidence)
    changes = compare_drives(pairs, finals, across)
    smaller = min(side.scored for side in sides)
    judgements = judge_over_drives(
        conditions, changes, levels, smaller=smaller, scales=_scales(fleets)
    )
    masks = [mask for mask in finals if mask[0] != BASELINE]
    comparison = FleetComparison(
        base=sides[0],
        new=sides[1],
        drives=len(pairs),
        by_log=matched.by_log,
        changes=tuple(changes),
        strata=tuple(change_strata(pairs, masks, _tags(fleets, pairs), across)),
        drive_changes=tuple(changed_drives(pairs, tested)),
        left_out=(*matched.left_out, *without),
        untested=tuple(untested),
        frames_left_out=(
            sum(pair.base_left_out for pair in pairs),
            sum(pair.new_left_out for pair in pairs),
        ),
        truths_differ=sum(pair.truth_differs > 0 for pair in pairs),
        settings_differ=_settings_differ(fleets, sides),
        names=_names(fleets),
        settings=settings,
    )
    return ComparedFleets(comparison, judgements)


def write(compared: ComparedFleets, path: Path, *, paper: Paper = Paper.A4) -> Path:
    """Write a comparison as PDF, page, Markdown or JSON, by the file's ending.

    Raises
    ------
    RoadevalError
        If the ending is another, or the file cannot be written.
    """
    known: dict[str, Callable[[], bytes]] = {
        ".pdf": lambda: pdf(document(compared.comparison, compared.judgements), paper),
        ".html": lambda: page(document(compared.comparison, compared.judgements)),
        ".md": lambda: markdown(compared.comparison, compared.judgements).encode(),
        ".json": lambda: as_json(compared).encode(),
    }
    if path.suffix.lower() not in known:
        raise RoadevalError(f"{path}: a comparison is written as {', '.join(known)}")
    return write_file(path, known[path.suffix.lower()]())


def as_json(compared: ComparedFleets) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))


def _sides(fleets: tuple[Fleet, Fleet]) -> tuple[FleetSide, FleetSide]:
    base, new = (
        FleetSide(
            label,
            len(own := _drives(fleet)),
            sum(each.scored for each in own.values()),
            fleet.summary["version"],
        )
        for label, fleet in zip(labels_of([f.path.resolve() for f in fleets]), fleets, strict=True)
    )
    return base, new


def _drives(fleet: Fleet) -> dict[str, FleetDrive]:
    rows = fleet.table("drives", ["drive", "sha256", "status", "evaluated"]).to_pylist()
    return {
        row["drive"]: FleetDrive(
            row["sha256"] or None, row["status"] in (SCORED, DAMAGED) and bool(row["evaluated"])
        )
        for row in rows
    }


def _levels(
    fleet: Fleet, variants: Sequence[str] | None
) -> tuple[list[Mask], dict[Mask, FleetLevel]]:
    """Return the new fleet's final masks, and every mask's rates over its drives."""
    columns = ["variant", "stage", "final", "region", *OUTCOMES, *METRICS]
    frame = fleet.table("scores", columns).to_pandas()
    frame = frame[frame["region"] == ALL]
    if variants:
        there = frame["variant"].unique()
        frame = frame[frame["variant"].isin(variants)]
        if not len(frame):
            raise RoadevalError(
                f"{fleet.path}: no variant {', '.join(variants)}; there are {', '.join(there)}"
            )
    finals: list[Mask] = []
    levels = {}
    for (variant, stage), rows in frame.groupby(["variant", "stage"], sort=False):
        mask = str(variant), str(stage)
        counts = Counts(*(int(rows[name].sum()) for name in OUTCOMES))
        means = {name: float(rows[name].mean()) for name in METRICS}
        pooled = {f"pooled_{name}": value for name, value in metrics.of(counts).items()}
        levels[mask] = FleetLevel(len(rows), means | pooled | metrics.overlap(counts))
        if rows["final"].all():
            finals.append(mask)
    return finals, levels


def _tested(finals: Sequence[Mask], drives: int) -> tuple[list[Mask], list[Mask]]:
    """Choose the final masks whose single drives are tested: the first, and more if few drives."""
    masks = [mask for mask in finals if mask[0] != BASELINE]
    most = max(TESTS // max(drives, 1), 1)
    return masks[:most], masks[most:]


def _pairs(
    fleets: tuple[Fleet, Fleet],
    matched: Matched,
    variants: Sequence[str] | None,
    tested: Sequence[Mask],
    settings: EvaluationSettings,
) -> Iterator[DrivePair]:
    groups = _groups(fleets)
    for base, new in matched.pairs:
        before, after = read_masks(fleets[0].path, base), read_masks(fleets[1].path, new)
        if variants:
            after = {mask: own for mask, own in after.items() if mask[0] in variants}
        group = groups.get(new) or groups.get(base) or new
        yield pair_drive(new, group, before, after, tested=tested, settings=settings)


def _groups(fleets: Sequence[Fleet]) -> dict[str, str]:
    return {
        each["drive"]: each["group"]
        for fleet in fleets
        for each in fleet.summary["drives"]
        if each["group"]
    }


def _tags(fleets: Sequence[Fleet], pairs: Sequence[DrivePair]) -> dict[str, list[str | None]]:
    """Return the tags of the new fleet's drives."""
    tags = {each["drive"]: each["tags"] for each in fleets[1].summary["drives"]}
    keys = sorted({key for own in tags.values() for key in own})
    return {key: [tags[pair.drive].get(key) for pair in pairs] for key in keys}


def _names(fleets: Sequence[Fleet]) -> dict[str, str]:
    """Return the drives' names; their identities where two of a fleet have one name."""
    names: dict[str, str] = {}
    for fleet in fleets:
        counted = Counter(each["name"] for each in fleet.summary["drives"])
        for each in fleet.summary["drives"]:
            names[each["drive"]] = each["name" if counted[each["name"]] == 1 else "drive"]
    return names


def _scales(fleets: tuple[Fleet, Fleet]) -> tuple[float | None, float | None]:
    base, new = (asked(fleet.summary).get("frames.scale") for fleet in fleets)
    return base, new


def _settings_differ(fleets: Sequence[Fleet], sides: Sequence[FleetSide]) -> SettingsDiffer | None:
    base, new = (asked(fleet.summary) for fleet in fleets)
    differing: Mapping[str, tuple[Any, Any]] = {
        name: (base[name], new[name]) for name in base if name in new and base[name] != new[name]
    }
    return SettingsDiffer(sides[0].label, sides[1].label, differing) if differing else None
