"""Results side by side: from recordings, results folders and fleets to a comparison."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import first_of
from roadeval.errors import RoadevalError
from roadeval.evaluation.comparison.compare import Comparison, variants_as_sides
from roadeval.evaluation.comparison.compare import compare as compare_sides
from roadeval.evaluation.comparison.conditions import Condition, Judgement, judge
from roadeval.evaluation.comparison.pairing import Side, one_drive
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.tables import concatenate, finals, only, values_of, windows
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.history import Listing, last_good, list_results
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.report.chart import Chart, looks, looks_of_results
from roadeval.report.charts.standard import over_windows
from roadeval.report.comment import badge
from roadeval.report.comparison import comment, document, markdown
from roadeval.report.writing import write_document, write_file
from roadeval.results.comparison import as_dict, junit_xml
from roadeval.results.facts import json_text, plain
from roadeval.results.schema import FAILED
from roadeval.runtime.files import Paths
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    import pandas as pd


SILENT_S: Final = 1.0
"""Seconds of a comparison after which its progress is told."""


@dataclass(frozen=True, eq=False)
class Compared:
    """A comparison with its judged conditions."""

    comparison: Comparison
    judgements: tuple[Judgement, ...]
    sides: tuple[Side, ...]
    """The results with the only drive that is compared; empty for several drives."""
    recordings: Mapping[str, DriveResult]
    """The recordings by the results' labels; a folder has none."""
    lost: tuple[str, ...] = ()
    """Drives of a fleet that failed; the warnings name them, too."""

    @property
    def content(self) -> dict[str, Any]:
        """The content of the JSON file."""
        return as_dict(self.comparison, self.judgements)


def compare(
    results: Paths | Listing,
    *,
    variants: Sequence[str] | None = None,
    fail_if: Sequence[str] = (),
    on_progress: OnProgress = ignore,
) -> Compared:
    """Compare results with the first of them, or the variants of one result with each other.

    A `RoadevalError` if a result cannot be read, or there is nothing to compare. A
    condition that cannot be judged has a judgement that says why.

    Parameters
    ----------
    results
        Recordings, results folders or fleets' folders. If there is only one, its variants are
        compared. The base may be a folder of many runs, of which the last good run is used, see
        `roadeval.history`.
    variants
        The variants to compare. For several results ``a=b`` compares ``a`` of the base with ``b``
        of the others. For a single result the first variant is the base; by default all are
        compared, with ``unfiltered`` as the base.
    fail_if
        Conditions, see `roadeval.evaluation.comparison.conditions`.
    """
    conditions = [Condition.parse(text) for text in fail_if]
    paths, unread = _choose_paths(list_results(results), on_progress)
    across = len(paths) == 1
    opened = [Result(path) for path in paths]
    if across:
        opened_side = Side(opened[0].name, opened[0].compared, partial(_read_table, opened[0]))
        sides = variants_as_sides(opened_side, opened[0].variants, variants)
        opened *= len(sides)
    else:
        sides = _choose_sides(opened, paths, variants)
    settings = opened[0].facts.evaluation
    drives, total = list[tuple[str, str]](), sum(len(side.scored) for side in sides)
    begun = time.monotonic()

    def read(side: Side, name: str, keys: Collection[tuple[str, str]]) -> pd.DataFrame:
        if name == "frames" and time.monotonic() - begun > SILENT_S:
            on_progress(Progress(len(drives), total, "comparing", unit="drives"))
        drives.extend(keys if name == "frames" else ())
        return side.tables(name, keys)

    watched = [replace(side, tables=partial(read, side)) for side in sides]
    comparison = compare_sides(watched, settings, across_variants=across)
    labelled = [*zip(sides, opened, strict=True)]
    cut = dict.fromkeys(
        result.name if across else side.label for side, result in labelled if not result.complete
    )
    ends = (f"{name} is a partial recording: the end of its drive is missing" for name in cut)
    lost = dict.fromkeys(filter(None, map(_failure_sentence, opened)))
    comparison = replace(comparison, warnings=(*lost, *unread, *ends, *comparison.warnings))
    one_drive_sides = sides if across and len(opened_side.scored) == 1 else one_drive(sides)
    recordings = {
        side.label: result.drive
        for side, result in labelled
        if result.drive and result.drive.recording
    }
    judgements = tuple(judge(comparison, conditions, settings))
    return Compared(comparison, judgements, tuple(one_drive_sides or ()), recordings, tuple(lost))


def _read_table(result: Result, name: str, drives: Collection[tuple[str, str]]) -> pd.DataFrame:
    return result.table(name, drives, final=name == "regions")


def _choose_paths(listing: Listing, on_progress: OnProgress) -> tuple[list[Path], Sequence[str]]:
    """Return the paths of the results, the base first, and why runs beside it cannot be read.

    A `RoadevalError` if there is none, or only a folder of several results.
    """
    if listing.errors:
        raise listing.errors[0]
    if not listing.places:
        raise RoadevalError("nothing to compare: name one result, or several")
    (first, paths), *others = listing.places
    if others:
        base, unread = last_good(listing, on_progress)
        return [base, *(path for path, _ in others)], unread
    if len(paths) > 1:
        raise RoadevalError(
            f"holds {len(paths)} results",
            where=first,
            remedy="name behind it the result to hold against them, or use 'roadeval history'",
        )
    return [*paths], ()


def _failure_sentence(result: Result) -> str:
    """Return a sentence on the drives of a fleet that failed; empty without any."""
    if result.fleet is None:
        return ""
    drives = result.fleet.drives
    failed = only(drives, status=FAILED)["name"].tolist()
    if not failed:
        return ""
    verb = "is" if len(failed) == 1 else "are"
    failures = f"{len(failed)} of {len(drives)} drives failed and {verb} in no number"
    return f"{result.name}: {failures}: {first_of(failed, NAMED)}"


def _choose_sides(
    opened: Sequence[Result], paths: Sequence[Path], variants: Sequence[str] | None
) -> list[Side]:
    """Return several results, each with the variants of it that are compared.

    A result is named by its file, or by its whole path if another has the same name.
    """
    stems = [visible(path.stem or path.resolve().stem or str(path)) for path in paths]
    labels: list[str] = []
    for stem, path in zip(stems, paths, strict=True):
        label = stem if stems.count(stem) == 1 else visible(str(path))
        labels.append(f"{label} ({labels.count(label) + 1})" if label in labels else label)
    pairs = [name.partition("=")[::2] for name in variants or ()]
    of_base = {base_name: other or base_name for base_name, other in pairs}
    of_others = {name: name for name in of_base.values()}
    renamed = ", ".join(base_name for base_name, other in of_base.items() if base_name != other)
    sides: list[Side] = []
    for label, result in zip(labels, opened, strict=True):
        names = of_others if sides else of_base
        if pairs and not {*names} & {*result.variants}:
            named_variants, choices = ", ".join(names), ", ".join(result.variants)
            raise RoadevalError(f"{label}: no variant {named_variants}; there are {choices}")
        title = f"{label} ({renamed})" if renamed and not sides else label
        read = partial(_read_table, result)
        sides.append(Side(title, result.compared, read, names if pairs else None))
    return sides


def write(compared: Compared, path: Path, kind: str = "", command: str = "") -> Path:
    """Write a comparison as PDF, page, Markdown, badge or JSON, by the file's ending.

    The ``kind`` may be "junit", or "comment", which has the ``command`` that repeats it. A
    `RoadevalError` if the ending is another, or the file cannot be written.
    """
    about = compared.comparison, compared.judgements
    if kind == "junit":
        return write_file(path, junit_xml(*about))
    if kind == "comment":
        return write_file(path, comment(*about, over_drive(compared), command).encode())
    if path.suffix.lower() == ".svg":
        return write_file(path, badge(*about).encode())

    def inspect(result: str, frame: int) -> str:
        drive = compared.recordings.get(result)
        return drive.inspect(frame) if drive else ""

    inspected = inspect if compared.recordings else None
    return write_document(
        *(path, "a comparison", lambda: document(*about, over_drive(compared), inspected)),
        lambda: markdown(*about),
        lambda: as_json(compared),
    )


def as_json(compared: Compared) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))


NAMED: Final = 5
"""Greatest number of failed drives that are named."""
ROWS: Final = 60
"""Greatest number of points of the figure over the drive."""


def _frames(side: Side) -> pd.DataFrame:
    """Return the rows of ``frames`` of the one drive that is compared."""
    return side.table("frames", [side.drives[0].key])


def over_drive(compared: Compared) -> list[Chart]:
    """Return ERR of results and baseline over the one drive, on the frames of all results."""
    masks_of = {side.label: finals(_frames(side)) for side in compared.sides}
    is_one_variant = all(values_of(rows, "variant") == [label] for label, rows in masks_of.items())
    masks, parts = {}, []
    for variant in dict.fromkeys(v for rows in masks_of.values() for v in rows["variant"]):
        rows_of = {label: only(rows, variant=variant) for label, rows in masks_of.items()}
        rows_of = {label: rows for label, rows in rows_of.items() if len(rows)}
        if not is_one_variant and (variant == BASELINE or len(rows_of) < len(masks_of)):
            continue
        common = set.intersection(*(set(rows["frame"]) for rows in rows_of.values()))
        for label, rows in rows_of.items() if common else ():
            name = label if is_one_variant else f"{label}: {variant}"
            masks[name] = label, variant
            in_all = rows[rows["frame"].isin(common)]
            parts.append(in_all.assign(variant=name, stage="final"))
    if not parts:
        return []
    rows = concatenate(parts).sort_values("frame", kind="stable")
    blind = finals(only(_frames(compared.sides[0]), variant=BASELINE))
    rows = concatenate([rows, blind[blind["frame"].isin(rows["frame"])].assign(stage="final")])
    size = compared.comparison.settings.window
    size *= max(-(-rows["frame"].nunique() // (size * ROWS)), 1)
    rows = rows.assign(drive="", camera="")  # the results may call them differently
    # Each variant has a colour, and each result has a dash.
    by_mask = looks_of_results(masks) | looks([BASELINE])
    return over_windows(windows(rows, size), [TESTED], by_mask)
