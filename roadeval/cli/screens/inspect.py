"""The worst frames on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from roadeval.cli.screens.tables import ascii_of, show_table
from roadeval.data.words import percent, points, short_names
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Table
from roadeval.results.sentences import without_filter

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.results.inspect import WorstFrame


def show(name: str, found: Sequence[WorstFrame], out: Console, *, of_fleet: bool) -> None:
    """Print the worst frames with their rates.

    Of a drive with the parts of ERR and the notes; of a fleet with whether the drive's recording
    was kept.
    """
    mask = f"{found[0].variant} by {found[0].by} of {found[0].stage}"
    scored = found[0].by == TESTED
    what, rule = "worst frames", "of neighbours only the worst"
    if not scored:
        what, rule = "without truth, frames to look at", "one a scene; a rank, and no error rate"
    elif of_fleet:
        rule = "of a drive at most three, a second apart"
    out.print(f"{name}: {what} of {mask} ({rule})")
    out.print()
    rates, rig = [*found[0].rates], any(each.camera for each in found)
    names = short_names([*dict.fromkeys(each.camera for each in found)])
    whose = ["drive"] if of_fleet else ["camera"] if rig else []
    more = ["kept"] if of_fleet else ["why"] if scored else []
    rows = [
        [
            str(each.rank),
            *([each.drive if of_fleet else names[each.camera]] if whose else []),
            str(each.frame),
            *(percent(each.rates[rate]) for rate in rates),
            *(["yes" if each.recording else "-"] if of_fleet else [_why(each)] if scored else []),
        ]
        for each in found
    ]
    titles = ["", *whose, "frame", *(f"{rate} %" for rate in rates), *more]
    words = [p for p, title in enumerate(titles) if title in ("drive", "camera", "why")]
    words = [0, *words] if of_fleet else words
    breaks = range(1, len(rows)) if more == ["why"] else ()
    show_table(Table(titles, rows, text_columns=words, breaks=breaks), out)
    if of_fleet and not all(each.recording for each in found):
        out.print()
        out.print("Where no recording was kept, --worst K says how to make it.")


def _why(frame: WorstFrame) -> str:
    (first, value), *rest = frame.parts.items()
    terms = [f"{first} {percent(value, 1)}", *(f"{name} {points(part, 1)}" for name, part in rest)]
    notes = without_filter(frame.notes) if rest else frame.notes
    # The title names the variant.
    notes = [note.removeprefix(f"{frame.variant} ") for note in notes]
    return " ".join([f"{ascii_of(', '.join(terms))} pp.", *(n[:1].upper() + n[1:] for n in notes)])
