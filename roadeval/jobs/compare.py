"""Results side by side: from recordings, results folders and fleets to a comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roadeval.errors import RoadevalError
from roadeval.evaluation import comparison
from roadeval.evaluation.comparison import (
    Comparison,
    Condition,
    Judgement,
    Kind,
    Note,
    Side,
    judge,
    one_drive,
)
from roadeval.jobs.result import Result
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.comparison import as_dict, judged, warnings
from roadeval.results.facts import json_text, plain
from roadeval.runtime.files import Paths, listed
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document
    from roadeval.report.sections.frames import BrowsedFrames

Inspect = Callable[[Path, int], str]
"""Returns the command that opens a frame of a recording."""


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A comparison with its judged conditions."""

    comparison: Comparison
    judgements: tuple[Judgement, ...]
    sides: tuple[Side, ...]
    """The results with the one drive that is compared; none where several are."""
    recordings: Mapping[str, Path]
    """By the results' labels; a folder has none."""

    @property
    def content(self) -> dict[str, Any]:
        """The content of the JSON file."""
        return as_dict(self.comparison, self.judgements)

    @property
    def warnings(self) -> list[str]:
        """What was left out, and what makes the results less comparable than they look."""
        return warnings(self.comparison)

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
        Recordings, results folders or fleets' folders. Of a single one the variants are compared.
    variants
        Of several results: only these, where ``a=b`` holds the base's ``a`` against the others'
        ``b``. Of a single one: these, the first being the base; by default all, ``unfiltered``
        first.
    fail_if
        Conditions, see `roadeval.evaluation.comparison.conditions`.

    Raises
    ------
    RoadevalError
        If a result cannot be read, or there is nothing to compare, or a condition not to be
        judged.
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
    found = replace(found, notes=(*(Note(Kind.END_MISSING, name) for name in cut), *found.notes))
    alone = sides if across and len(whole.scored) == 1 else one_drive(sides)
    recordings = {side.label: each.recording for side, each in labelled if each.recording}
    return Compared(found, judge(found, conditions, settings), tuple(alone or ()), recordings)


# --- Sides ----------------------------------------------------------------------------------------


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


# --- Writing files --------------------------------------------------------------------------------


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
    match path.suffix.lower():
        case ".pdf":
            content = pdf(_document(compared, inspect), paper)
        case ".html":
            content = _page(compared, inspect)
        case ".md":
            from roadeval.report.comparison import markdown

            content = markdown(compared.comparison, compared.judgements).encode()
        case ".json":
            content = as_json(compared).encode()
        case _:
            raise RoadevalError(f"{path}: a comparison is written as .pdf, .html, .md, .json")
    return write_file(path, content)


def _page(compared: Compared, inspect: Inspect | None) -> bytes:
    from roadeval.jobs.page_comparison import browsed
    from roadeval.report.page.render import page
    from roadeval.report.sections.frames import browser

    made = _document(compared, inspect)

    def rendered(frames: BrowsedFrames) -> bytes:
        return page(replace(made, blocks=[*made.blocks, *browser(frames)]))

    compared_at = compared.comparison, compared.sides, compared.recordings
    frames = browsed(*compared_at, inspect, lambda frames: len(rendered(frames)))
    return page(made) if frames is None else rendered(frames)


def _document(compared: Compared, inspect: Inspect | None) -> Document:
    from roadeval.jobs.page_comparison import over_drive
    from roadeval.report.comparison import document

    def command(result: str, frame: int) -> str:
        path = compared.recordings.get(result)
        return inspect(path, frame) if inspect and path else ""

    return document(
        compared.comparison,
        compared.judgements,
        over_drive(compared.comparison, compared.sides),
        command if inspect and compared.recordings else None,
    )


def as_json(compared: Compared) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))
