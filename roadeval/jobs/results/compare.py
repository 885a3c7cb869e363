"""Results side by side: from recordings, results folders and fleets to a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows
from roadeval.data.result import joined
from roadeval.data.words import first_of
from roadeval.errors import RoadevalError
from roadeval.evaluation import comparison, score
from roadeval.evaluation.comparison import (
    Comparison,
    Condition,
    Judgement,
    Side,
    judge,
    one_drive,
)
from roadeval.evaluation.score import TESTED
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.report.chart import Chart, Look, looks, looks_of_results
from roadeval.report.charts.standard import over_windows
from roadeval.report.pdf.typeset import pdf, write_file
from roadeval.results.comparison import as_dict, judged, junit_xml
from roadeval.results.facts import json_text, plain
from roadeval.results.rows import window_table
from roadeval.results.schema import FAILED
from roadeval.runtime.files import Paths, listed
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document


@dataclass(frozen=True, eq=False)
class Compared:
    """A comparison with its judged conditions."""

    comparison: Comparison
    judgements: tuple[Judgement, ...]
    sides: tuple[Side, ...]
    """The results with the one drive that is compared; none where several are."""
    recordings: Mapping[str, DriveResult]
    """By the results' labels; a folder has none."""
    lost: tuple[str, ...] = ()
    """Which drives of a fleet failed, so that no number counts them; among the warnings, too."""

    @property
    def content(self) -> dict[str, Any]:
        """The content of the JSON file."""
        return as_dict(self.comparison, self.judgements)

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold."""
        return [judged(judgement) for judgement in self.judgements if judgement.holds]

    @property
    def unjudged(self) -> list[str]:
        """Why conditions could not be judged."""
        return [judged(judgement) for judgement in self.judgements if judgement.holds is None]


def compare(
    results: Paths, *, variants: Sequence[str] | None = None, fail_if: Sequence[str] = ()
) -> Compared:
    """Compare results with the first of them, or the variants of one result with each other.

    A `RoadevalError` if a result cannot be read, or there is nothing to compare. Why a condition
    cannot be judged is in `Compared.unjudged`.

    Parameters
    ----------
    results
        Recordings, results folders or fleets' folders. Of a single one the variants are compared.
    variants
        Of several results: only these, where ``a=b`` holds the base's ``a`` against the others'
        ``b``. Of a single one: these, the first being the base; by default all, ``unfiltered``
        first.
    fail_if
        Conditions, see `roadeval.evaluation.comparison.conditions`.
    """
    conditions = [Condition.parse(text) for text in fail_if]
    paths = [Path(path) for path in listed(results)]
    across = len(paths) == 1
    opened = [Result(path) for path in paths]
    if across:
        whole = Side(opened[0].name, opened[0].parts)
        sides = comparison.variants_as_sides(whole, opened[0].variants, variants)
        opened *= len(sides)
    else:
        sides = _sides(opened, _labels(paths), variants)
    settings = opened[0].facts.evaluation
    found = comparison.compare(sides, settings, across_variants=across)
    labelled = [*zip(sides, opened, strict=True)]
    cut = dict.fromkeys(
        each.name if across else side.label for side, each in labelled if not each.complete
    )
    partial = (f"{name} is a partial recording: the end of its drive is missing" for name in cut)
    lost = dict.fromkeys(filter(None, map(_failed_drives, opened)))
    found = replace(found, warnings=(*lost, *partial, *found.warnings))
    alone = sides if across and len(whole.scored) == 1 else one_drive(sides)
    recordings = {
        side.label: each.drive for side, each in labelled if each.drive and each.drive.recording
    }
    judgements = tuple(judge(found, conditions, settings))
    return Compared(found, judgements, tuple(alone or ()), recordings, tuple(lost))


def _failed_drives(result: Result) -> str:
    """Return a sentence on the drives of a fleet that failed; empty without any."""
    rows = result.fleet.drives if result.fleet else {}
    failed = [row["name"] for row in rows.values() if row["status"] == FAILED]
    if not failed:
        return ""
    named = first_of(failed, NAMED)
    return f"{result.name}: {len(failed)} of {len(rows)} drives failed, no number counts {named}"


def _sides(
    opened: Sequence[Result], labels: Sequence[str], variants: Sequence[str] | None
) -> list[Side]:
    """Return several results, each with those of its variants that are compared."""
    pairs = [name.partition("=")[::2] for name in variants or ()]
    of_base = {own: other or own for own, other in pairs}
    of_others = {name: name for name in of_base.values()}
    renamed = ", ".join(own for own, other in of_base.items() if own != other)
    sides: list[Side] = []
    for label, each in zip(labels, opened, strict=True):
        names = of_others if sides else of_base
        if pairs and not {*names} & {*each.variants}:
            wanted, known = ", ".join(names), ", ".join(each.variants)
            raise RoadevalError(f"{label}: no variant {wanted}; there are {known}")
        named = f"{label} ({renamed})" if renamed and not sides else label
        sides.append(Side(named, each.parts, names if pairs else None))
    return sides


def _labels(paths: Sequence[Path]) -> list[str]:
    """Name each result by its file, or by its whole path where another has the same name."""
    stems = [visible(path.stem or path.resolve().stem or str(path)) for path in paths]
    labels: list[str] = []
    for stem, path in zip(stems, paths, strict=True):
        label = stem if stems.count(stem) == 1 else visible(str(path))
        labels.append(f"{label} ({labels.count(label) + 1})" if label in labels else label)
    return labels


def write(compared: Compared, path: Path) -> Path:
    """Write a comparison as PDF, page, Markdown or JSON, by the file's ending.

    A `RoadevalError` if the ending is another, or the file cannot be written.
    """
    match path.suffix.lower():
        case ".pdf":
            content = pdf(_document(compared))
        case ".html":
            content = as_page(compared)
        case ".md":
            from roadeval.report.comparison import markdown

            content = markdown(compared.comparison, compared.judgements).encode()
        case ".json":
            content = as_json(compared).encode()
        case _:
            raise RoadevalError(f"{path}: a comparison is written as .pdf, .html, .md, .json")
    return write_file(path, content)


def as_page(compared: Compared) -> bytes:
    """Return a comparison as a page that is whole by itself."""
    from roadeval.report.page.render import page

    return page(_document(compared))


def _document(compared: Compared) -> Document:
    from roadeval.report.comparison import document

    def command(result: str, frame: int) -> str:
        drive = compared.recordings.get(result)
        return drive.inspect(frame) if drive else ""

    return document(
        *(compared.comparison, compared.judgements, over_drive(compared)),
        command if compared.recordings else None,
    )


def write_junit(compared: Compared, path: Path) -> Path:
    """Write what changed and the judged conditions as JUnit's XML.

    A `RoadevalError` if the file cannot be written.
    """
    return write_file(path, junit_xml(compared.comparison, compared.judgements))


def as_json(compared: Compared) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))


NAMED: Final = 5
"""Drives that failed, which are named."""
ROWS: Final = 60
"""Points of the figure over the drive, at most."""


@dataclass(frozen=True)
class ComparedMask:
    """A final mask that is compared."""

    name: str
    result: str
    variant: str


def compared_masks(sides: Sequence[Side]) -> tuple[list[ComparedMask], Rows] | None:
    """Return the final masks that all results have, and their rows in the order of the frames.

    Each mask's rows have its name as variant; of a variant they are those of the frames on which
    all results have its mask. Where the variants of one result are compared, each is a result.
    None without any.
    """
    finals = {side.label: score.finals(side.rows(side.parts[0], "frames")) for side in sides}
    alone = all(rows.distinct("variant") == [label] for label, rows in finals.items())
    masks, parts = [], []
    for variant in dict.fromkeys(v for rows in finals.values() for v in rows.distinct("variant")):
        own = [side for side in sides if variant in finals[side.label].distinct("variant")]
        if not alone and (variant == BASELINE or len(own) < len(sides)):
            continue
        found = [finals[side.label].of_variant(variant) for side in own]
        common = [*set.intersection(*(set(rows["frame"].tolist()) for rows in found))]
        for side, rows in zip(own, found, strict=True) if common else ():
            name = side.label if alone else f"{side.label}: {variant}"
            kept = rows.take(np.isin(rows["frame"], common))
            masks.append(ComparedMask(name, side.label, variant))
            columns = (np.full(len(kept), text) for text in (name, "final"))
            parts.append(kept.replace(**dict(zip(("variant", "stage"), columns, strict=True))))
    if not parts:
        return None
    rows = joined(parts)
    return masks, rows.take(np.argsort(rows["frame"], kind="stable"))


def _looks_of(masks: Sequence[ComparedMask]) -> dict[str, Look]:
    """Return how masks are drawn: a hue a variant, a dash a result."""
    return looks_of_results({mask.name: (mask.result, mask.variant) for mask in masks})


def over_drive(compared: Compared) -> list[Chart]:
    """Return ERR over the one drive that is compared, and the baseline's; none of several."""
    if (found := compared_masks(compared.sides)) is None:
        return []
    masks, rows = found
    base = compared.sides[0]
    blind = score.finals(base.rows(base.parts[0], "frames").of_variant(BASELINE))
    rows = joined([rows, blind.take(np.isin(blind["frame"], rows["frame"]))])
    size = compared.comparison.settings.window
    size *= max(-(-len(rows.distinct("frame")) // (size * ROWS)), 1)
    windows = window_table(score.camera_masks(rows), size)
    return over_windows(windows, [TESTED], _looks_of(masks) | looks([BASELINE]))
