"""Results side by side: from recordings, results folders and fleets to a comparison."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.rows import joined
from roadeval.errors import RoadevalError
from roadeval.evaluation import comparison, score
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
from roadeval.evaluation.score import TESTED
from roadeval.evaluation.settings import settings_of
from roadeval.jobs.result import Result
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.comparison import as_dict, judged, warnings
from roadeval.results.rows import as_arrays, window_rows
from roadeval.results.summary import json_text, plain
from roadeval.runtime.files import Paths, listed
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document
    from roadeval.report.chart import Chart
    from roadeval.report.sections.browse import BrowsedFrames

Inspect = Callable[[Path, int], str]
"""Returns the command that opens a frame of a recording."""
Writer = Callable[["Compared", Paper, Inspect | None], bytes]
"""Returns a comparison as the content of a file."""
ROWS: Final = 60
"""Points of the figure over the drive, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A comparison with its judged conditions."""

    comparison: Comparison
    judgements: tuple[Judgement, ...]
    sides: tuple[Side, ...]
    """The results with the one drive that is compared; none where several are."""
    recordings: Mapping[str, Path]
    """By the results' labels; a folder has none."""

    def over_drive(self) -> list[Chart]:
        """Return ERR over the one drive that is compared, of the masks that all results have."""
        from roadeval.jobs.page_comparison import looks_of, masks_of, table_of
        from roadeval.report.chart import looks
        from roadeval.report.charts.rates import over_windows

        frames = {side.label: side.rows(side.parts[0], "frames") for side in self.sides}
        masks = masks_of(self.sides, frames)
        if not masks:
            return []
        blind = score.finals(frames[self.sides[0].label].of_variant(BASELINE))
        rows = table_of(masks, frames)
        rows = joined([rows, blind.take(np.isin(blind["frame"], rows["frame"]))])
        size = self.comparison.settings.window
        size *= max(-(-len(rows.distinct("frame")) // (size * ROWS)), 1)
        windows = as_arrays("windows", window_rows(score.windows(rows, size)))
        return over_windows(windows, [TESTED], looks_of(masks) | looks([BASELINE]))

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
        sides = _sides(opened, labels_of(paths), variants)
    settings = settings_of(opened[0].summary)
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


def labels_of(paths: Sequence[Path]) -> list[str]:
    """Call each result by its file's name, or where that is not its own by its whole path."""
    stems = [visible(path.stem or path.resolve().stem or str(path)) for path in paths]
    counted = Counter(stems)
    labels: list[str] = []
    for stem, path in zip(stems, paths, strict=True):
        label = stem if counted[stem] == 1 else visible(str(path))
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
        compared.over_drive(),
        command if inspect and compared.recordings else None,
    )


def _markdown(compared: Compared, *_: object) -> bytes:
    from roadeval.report.comparison import markdown

    return markdown(compared.comparison, compared.judgements).encode()


def as_json(compared: Compared) -> str:
    """Write a comparison as JSON; undefined numbers become null."""
    return json_text(plain(compared.content))
