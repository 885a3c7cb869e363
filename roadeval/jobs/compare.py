"""Results side by side: from recordings or results folders to a comparison and its files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows
from roadeval.data.rows import joined
from roadeval.errors import RoadevalError
from roadeval.evaluation import comparison, scored
from roadeval.evaluation.comparison import Side
from roadeval.evaluation.comparison_result import Comparison, EndMissing
from roadeval.evaluation.conditions import Condition, Judgement, judge
from roadeval.evaluation.frame_counts import Window
from roadeval.evaluation.settings import settings_of
from roadeval.jobs.result import Result
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.comparison import as_dict, judged
from roadeval.results.rows import as_arrays, window_rows
from roadeval.results.summary import json_text, plain
from roadeval.runtime.paths import Paths, listed
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document
    from roadeval.report.sections.browse import BrowsedFrames

ASKED: Final = {
    "topics": ("image", "truth", "shadow", "masks", "sync_tolerance_ms", "resize_truth"),
    "labels": ("road", "ignore", "road_colors", "ignore_colors"),
    "frames": ("every", "scale"),
}
"""Settings that change a frame's numbers, or which frames are seen."""
Inspect = Callable[[Path, int], str]
"""Returns the command that opens a frame of a recording."""
Writer = Callable[["Compared", Paper, Inspect | None], bytes]
"""Returns a comparison as the content of a file."""
ROWS: Final = 60
"""Points of the figure over the drive, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A comparison with its judged conditions.

    Parameters
    ----------
    comparison
        See `roadeval.evaluation.comparison.compare`.
    judgements
        Of the conditions, see `roadeval.evaluation.conditions.judge`.
    sides
        The results.
    recordings
        By the results' labels; a results folder has none.
    """

    comparison: Comparison
    judgements: tuple[Judgement, ...]
    sides: tuple[Side, ...]
    recordings: Mapping[str, Path]

    @property
    def windows(self) -> Rows:
        """ERR and the rest over the drive, with each result as a variant.

        Without rows for different drives.
        """
        size = self.comparison.settings.window
        found = _windows(self.sides, size) if self.comparison.same_drive else ()
        return as_arrays("windows", window_rows(found))

    @property
    def content(self) -> dict[str, Any]:
        """The content of the JSON file."""
        return as_dict(self.comparison, self.judgements)

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold."""
        return [judged(judgement) for judgement in self.judgements if judgement.holds]


def compare(
    results: Paths,
    *,
    variants: Sequence[str] | None = None,
    fail_if: Sequence[str] = (),
) -> Compared:
    """Compare results with the first of them, or the variants of one result with each other.

    Parameters
    ----------
    results
        Recordings or results folders. Of a single one the variants are compared.
    variants
        Of several results: only these, where ``a=b`` holds the base's ``a`` against the others'
        ``b``. Of a single one: these, the first being the base; by default all, ``unfiltered``
        first.
    fail_if
        Conditions, see `roadeval.evaluation.conditions`.

    Raises
    ------
    RoadevalError
        If a result cannot be read, or there is nothing to compare, or a condition not to be
        judged.
    """
    conditions = [Condition.parse(text) for text in fail_if]
    opened = [Result(path) for path in listed(results)]
    across = len(opened) == 1
    if across:
        (only,) = opened
        names = [only.name]
        sides = comparison.variants_as_sides(_side(only.name, only, only.rows), variants)
    else:
        names = labels_of([each.path for each in opened])
        sides = _sides(names, opened, variants)
        names = [side.label for side in sides]
    settings = settings_of(opened[0].summary)
    found = comparison.compare(sides, settings, across_variants=across)
    cut = [EndMissing(name) for name, each in zip(names, opened, strict=True) if not each.complete]
    found = replace(found, notes=(*cut, *found.notes))
    judgements = judge(found, conditions, settings)
    held = opened * len(sides) if across else opened
    recordings = {
        side.label: result.path
        for side, result in zip(sides, held, strict=True)
        if result.recording is not None
    }
    return Compared(found, judgements, tuple(sides), recordings)


def write(
    compared: Compared, path: Path, *, paper: Paper = Paper.A4, inspect: Inspect | None = None
) -> Path:
    """Write a comparison as PDF, page, Markdown or JSON, by the file's ending.

    Parameters
    ----------
    compared
        The comparison.
    path
        The file.
    paper
        Of a PDF.
    inspect
        Returns the command that opens a frame of a recording, for the reader to type.

    Raises
    ------
    RoadevalError
        If the ending is another, or the file cannot be written.
    """
    return write_file(path, writer(path)(compared, paper, inspect))


def writer(path: Path) -> Writer:
    """Choose what writes a file by its ending.

    Raises
    ------
    RoadevalError
        If nothing does.
    """
    known: dict[str, Writer] = {
        ".pdf": _pdf,
        ".html": _page,
        ".md": _markdown,
        ".json": lambda compared, *_: as_json(compared).encode(),
    }
    if path.suffix.lower() not in known:
        raise RoadevalError(f"{path}: a comparison is written as {', '.join(known)}")
    return known[path.suffix.lower()]


def _pdf(compared: Compared, paper: Paper, inspect: Inspect | None) -> bytes:
    return pdf(_document(compared, inspect), paper)


def _page(compared: Compared, _: Paper, inspect: Inspect | None) -> bytes:
    from roadeval.jobs.page_comparison import browsed
    from roadeval.report.page.render import page
    from roadeval.report.sections import browse

    made = _document(compared, inspect)
    if not compared.comparison.same_drive:
        return page(made)

    def rendered(frames: BrowsedFrames) -> bytes:
        return page(replace(made, blocks=[*made.blocks, *browse.section(frames)]))

    compared_at = compared.comparison, compared.sides, compared.recordings
    frames = browsed(*compared_at, inspect, lambda frames: len(rendered(frames)))
    return page(made) if frames is None else rendered(frames)


def _document(compared: Compared, inspect: Inspect | None) -> Document:
    from roadeval.report.comparison import document

    def command(result: str, frame: int) -> str:
        path = compared.recordings.get(result)
        return inspect(path, frame) if inspect and path else ""

    return document(
        compared.comparison,
        compared.judgements,
        compared.windows,
        command if inspect and compared.recordings else None,
    )


def _markdown(compared: Compared, *_: object) -> bytes:
    from roadeval.report.comparison import markdown

    return markdown(compared.comparison, compared.judgements).encode()


def as_json(compared: Compared) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))


def asked(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a result's log was asked for that changes a frame's numbers, by the settings."""
    run = summary.get("run", {})
    return {
        f"{table}.{key}": run[table][key]
        for table, keys in ASKED.items()
        for key in keys
        if key in run.get(table, {})
    }


def _sides(
    labels: Sequence[str], opened: Sequence[Result], variants: Sequence[str] | None
) -> list[Side]:
    """Return several results, each with those of its variants that are compared."""
    pairs = [name.partition("=")[::2] for name in variants or ()]
    of_base = {own: other or own for own, other in pairs}
    of_others = {name: name for name in of_base.values()}
    renamed = ", ".join(own for own, other in of_base.items() if own != other)
    sides = []
    for place, (label, each) in enumerate(zip(labels, opened, strict=True)):
        whole = _side(label, each, each.rows)
        if pairs:
            whole = _chosen(whole, of_others if place else of_base)
        if renamed and not place:
            whole = replace(whole, label=f"{label} ({renamed})")
        sides.append(whole)
    return sides


def _chosen(side: Side, names: Mapping[str, str]) -> Side:
    """Return a result with these variants alone, each under its new name."""
    there = side.frames.distinct("variant")
    if not set(names) & set(there):
        wanted, known = ", ".join(names), ", ".join(there)
        raise RoadevalError(f"{side.label}: no variant {wanted}; there are {known}")
    regions = None if side.regions is None else _under(side.regions, names)
    own = {name: each for each, name in names.items()}
    return replace(side, frames=_under(side.frames, names), regions=regions, own_names=own)


def _under(rows: Rows, names: Mapping[str, str]) -> Rows:
    own = rows.take(np.isin(rows["variant"], [*names]))
    return own.replace(variant=np.array([names[name] for name in own["variant"].tolist()], str))


def _side(label: str, opened: Result, rows: Rows) -> Side:
    return Side(
        label,
        opened.name,
        _digest(opened),
        rows,
        asked(opened.summary),
        opened.table("regions"),
        opened.table("disagreements"),
    )


def _digest(opened: Result) -> str | None:
    digest = opened.summary.get("log", {}).get("sha256")
    return str(digest) if digest else None


def labels_of(paths: Sequence[Path]) -> list[str]:
    """Call each result by its file's name, or where that is not its own by its whole path."""
    stems = [visible(path.stem or str(path)) for path in paths]
    counted = Counter(stems)
    labels: list[str] = []
    for stem, path in zip(stems, paths, strict=True):
        label = stem if counted[stem] == 1 else visible(str(path))
        labels.append(f"{label} ({labels.count(label) + 1})" if label in labels else label)
    return labels


def _windows(sides: Sequence[Side], size: int) -> Iterator[Window]:
    """Cut each result's first variant, and the base's baseline, into windows of common frames."""
    tables = []
    for side in sides:
        own = side.frames.of_variant(side.frames["variant"][0])
        tables.append(own.replace(variant=np.full(len(own), side.label)))
    common = set.intersection(*(set(table["frame"].tolist()) for table in tables))
    together = joined([*tables, sides[0].frames.of_variant(BASELINE)])
    size *= max(-(-len(common) // (size * ROWS)), 1)
    return scored.windows(together.take(np.isin(together["frame"], [*common])), size)
