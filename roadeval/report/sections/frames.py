"""Frames to look at: in a report the worst and the most changed ones, on a page all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from roadeval.data import BASELINE
from roadeval.data.words import in_percent, listing, number, percent, points, timestamp
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.report.blocks import (
    Block,
    Cell,
    Command,
    Heading,
    ImageGrid,
    KeepTogether,
    Picture,
    Strip,
    Table,
    Text,
    TwoColumns,
)
from roadeval.report.chart import Chart
from roadeval.report.findings import Findings, NotableFrame
from roadeval.report.images import LayerImage, jpeg
from roadeval.report.tables import variant_cell
from roadeval.results.sentences import step_by_step, without_filter
from roadeval.results.verdict import focus_of

LARGE: Final = 420
SMALL: Final = 200
"""Pixels across the pictures of outcomes and of layers."""
LEAST: Final = 4
MOST: Final = 6
"""Pictures of outcomes that have room beside each other, at least and at most."""

NO_COMMAND: Final = (
    "No command opens them in the viewer, for the recording of this run is not where it was "
    "written; a report of the recording names one for each."
)


def worst_frames(findings: Findings) -> Iterator[Block]:
    """Yield the worst frames with all their layers, then those that the filter changed most."""
    focus = focus_of(findings.finals)
    if focus is None:
        if (found := findings.facts.unlabelled) and found.sign:
            rule = f"Highest {found.sign} of {found.variant}: {SIGNS[found.sign]}. One a scene."
            head = [Heading("Frames to look at"), Text(f"{rule} No error rate is known.", "note")]
            yield from _frames(findings, head, findings.worst)
        return
    if not findings.worst:
        yield Heading(f"The worst frames of {focus}")
        yield Text(f"ERR of {focus} is undefined on every frame, so no frame is the worst.")
    rule = f"Highest ERR of {focus}; of a scene only the worst, above the mean."
    rows = (row for frame in findings.worst for row in frame.layers if row)
    if stepped := list(dict.fromkeys(row[0].title.partition(":")[0] for row in rows)):
        rule += f" Below the errors are the steps of {listing(stepped)}, from left to right."
    head = [Heading(f"The worst frames of {focus}"), Text(rule, "note")]
    if not findings.inspect:
        head.append(Text(NO_COMMAND, "note"))
    yield from _frames(findings, head, findings.worst)
    helped = Heading("Frames that the filter helped most", 2)
    # Those among the worst are above already.
    harmed = Heading("Further frames that the filter harmed most", 2)
    yield from _frames(findings, [helped], findings.helped)
    yield from _frames(findings, [harmed], findings.harmed)


def _frames(
    findings: Findings, head: Sequence[Block], frames: Sequence[NotableFrame]
) -> Iterator[Block]:
    """Yield frames below a heading, which is on the page of the first of them."""
    for place, frame in enumerate(frames):
        yield KeepTogether([*(head if place == 0 else ()), *notable_frame(findings, frame)])


def notable_frame(findings: Findings, frame: NotableFrame) -> Iterator[Block]:
    """Yield a frame with its sentences, rates and pictures."""
    stamp, *facts = sentences_about(frame)
    if frame.change is not None:
        facts = [f"The filter changes ERR by {points(frame.change)} pp."]
    elif notes := _notes(frame):
        facts[-len(notes) :] = [" ".join(notes)]
    sentences = [Text(sentence, "note") for sentence in (stamp, *facts)]
    title = Text(f"Frame {frame.frame}", "title")
    if frame.rates:
        rates = rates_of(frame, [*findings.finals])
        yield TwoColumns([title, *sentences], [rates], 0.55)
    else:
        yield from (title, *sentences)
    if frame.images:
        pictures = [(image.title, jpeg(image, LARGE)) for image in frame.images]
        lines = -(-len(pictures) // MOST)
        yield ImageGrid(pictures, max(LEAST, -(-len(pictures) // lines)))
    columns = max((len(row) for row in frame.layers), default=0)
    for row in frame.layers:
        pictures = [(image.title, jpeg(image, SMALL)) for image in row]
        yield ImageGrid(pictures, columns, skip=columns - len(row))
    if findings.inspect:
        yield Command(findings.inspect(frame.frame))


def rates_of(frame: NotableFrame, variants: Sequence[str]) -> Table:
    """Tabulate the rates of each variant's final mask; ``variants`` are all that were scored."""
    rows = [
        [
            variant_cell(name, variants),
            *(
                Cell(percent(rates.get(rate)), bold=(name, rate) == (frame.variant, TESTED))
                for rate in SHORT
            ),
        ]
        for name, rates in frame.rates.items()
    ]
    return Table(["final mask, %", *SHORT], rows, small=True)


def sentences_about(frame: NotableFrame) -> Iterator[str]:
    """Yield when it was, which stage its error comes from, and its notes."""
    yield f"Stamp {timestamp(frame.stamp_ns)}"
    if len(frame.parts) > 1:
        parts = {name: in_percent(part) for name, part in frame.parts.items()}
        yield f"{frame.variant}: {step_by_step(parts)}."
    yield from _notes(frame)


def _notes(frame: NotableFrame) -> list[str]:
    """Return a frame's notes, without that on the filter where the parts of its error have it."""
    return without_filter(frame.notes) if len(frame.parts) > 1 else [*frame.notes]


LARGE_ON_PAGE: Final = 640
SMALL_ON_PAGE: Final = 300
"""Pixels across the pictures of outcomes and of layers."""
ROWS: Final = 2000
"""Frames in the table, at most; of a longer drive those with the highest error rate."""


@dataclass(frozen=True)
class FrameBrowser(Block):
    """The frames of a drive on a page: one with its pictures, and a table of all."""

    rows: Sequence[NotableFrame]
    """The frames of the drive, in order."""
    variants: Sequence[str]
    """Those that were scored, or without truth are in doubt."""
    charts: Sequence[Chart]
    """Rates along the drive."""
    command: str = ""
    """Opens a frame in the viewer, with ``{}`` for its number; empty without a recording."""
    strips: Sequence[Strip] = ()
    """Frames with their pictures, in order."""
    masks: Sequence[str] = ()
    """Names of the pictures of final masks, which are compared where there is no truth."""
    titles: Sequence[str] = ()
    """The rates, or without truth the signs of doubt, of which each variant has a column."""

    @property
    def pictured(self) -> frozenset[int]:
        """The frames whose pictures can be had."""
        return frozenset(strip.frame for strip in self.strips)

    @property
    def shown(self) -> list[NotableFrame]:
        """The frames of the table: all, or of a long drive the worst and the pictured."""
        if len(self.rows) <= ROWS:
            return [*self.rows]
        ranked = sorted(self.rows, key=lambda row: -row.error)
        wanted = {strip.frame for strip in self.strips} | {row.frame for row in ranked[:ROWS]}
        return [row for row in self.rows if row.frame in wanted]

    def cells(self, row: NotableFrame) -> Iterator[str]:
        """Yield a frame's seconds from the first one, and a number for each column of rates."""
        yield f"{(row.stamp_ns - self.rows[0].stamp_ns) / 1e9:.2f}"
        for rate in self.titles:
            for variant in self.variants:
                yield percent(row.rates.get(variant, {}).get(rate))

    @property
    def conditions(self) -> dict[str, int]:
        """Return the conditions that frames have, in words, each with a number."""
        words = dict.fromkeys(each for row in self.shown for each in row.conditions)
        return {each: place for place, each in enumerate(words)}

    @property
    def first(self) -> int | None:
        """The frame that is shown at first: the worst one with a picture; None without any."""
        there = [row for row in self.rows if row.frame in self.pictured]
        return max(there, key=lambda row: row.error).frame if there else None

    @property
    def compared(self) -> tuple[str, str]:
        """The pictures that are laid over each other: errors of two variants, or their masks."""
        scored = self.variants if TESTED in self.titles else ()
        errors = [f"{name}: errors" for name in scored if name != BASELINE]
        first, *others = errors or [*self.masks] or ["camera"]
        return first, next(iter(others), "camera")

    @property
    def note(self) -> str:
        """Return what the table is of and what it leaves out, in sentences."""
        told, of = [], number(len(self.rows))
        if (shown := len(self.shown)) < len(self.rows):
            told.append(
                f"The {number(shown)} of {of} frames with the highest {next(iter(self.titles))}; "
                f"{'frames' if TESTED in self.titles else 'unlabelled'}.csv has them all."
            )
        if self.variants:
            told.append("Percent.")
        if 0 < len(self.strips) < len(self.rows):
            told.append(f"{len(self.strips)} of {of} frames have their pictures on this page.")
        return " ".join(told)


def browser(frames: FrameBrowser | None) -> Iterator[Block]:
    """Yield the section of a page that browses the frames; nothing where there are none."""
    if frames and frames.rows:
        yield Heading("Frames")
        yield frames


def strip(
    frame: NotableFrame, variants: Sequence[str], command: str = "", layers: int = SMALL_ON_PAGE
) -> Strip:
    """Return a frame with its pictures, which are encoded here.

    ``variants`` are all that were scored, for their colours; ``command`` opens the frame in the
    viewer; the pictures of layers are at most ``layers`` pixels across.
    """
    return Strip(
        frame.frame,
        [*sentences_about(frame)],
        rates_of(frame, variants) if frame.rates else None,
        list(_rows(frame, layers)),
        command,
    )


def _rows(frame: NotableFrame, layers: int) -> Iterator[list[Picture]]:
    yield [_picture(image, image.title, LARGE_ON_PAGE) for image in frame.images]
    for row in frame.layers:
        variant = row[0].title.partition(":")[0] if row else ""
        names = [
            image.title if p == 0 else f"{variant}: {image.title}" for p, image in enumerate(row)
        ]
        # Without truth the last mask is what is looked at.
        last = row[-1] if row and not frame.rates else None
        yield [
            _picture(image, name, LARGE_ON_PAGE if image is last else layers)
            for name, image in zip(names, row, strict=True)
        ]


def _picture(image: LayerImage, name: str, width: int) -> Picture:
    title = image.spec.title if image.spec else image.title
    return Picture(name, title, jpeg(image, width))
