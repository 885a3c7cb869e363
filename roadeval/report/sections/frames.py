"""Frames to look at: a report has the worst and the most changed frames, a page all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from roadeval.data import ERRORS
from roadeval.data.arrays import Sums
from roadeval.data.words import listing, number, percent, points, timestamp
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
from roadeval.report.captions import caption, captions, note
from roadeval.report.chart import Chart
from roadeval.report.film import Film
from roadeval.report.findings import Findings, NotableFrame
from roadeval.report.images import LayerImage, jpeg, painted
from roadeval.report.tables import variant_cell

LARGE: Final = 420
SMALL: Final = 200
"""Pixels across the pictures of outcomes and of layers."""
LEAST: Final = 4
MOST: Final = 6
"""Least and greatest number of pictures of outcomes in a row."""


def worst_frames(findings: Findings) -> Iterator[Block]:
    """Yield the worst frames with all their layers, and the frames that the filter changed most."""
    focus = findings.facts.focus
    if focus is None:
        if (doubt := findings.facts.unlabelled) and doubt.sign:
            meaning = SIGNS[doubt.sign]
            rule = note("frames in doubt", sign=doubt.sign, variant=doubt.variant, meaning=meaning)
            yield from _frames(findings, [Heading("Frames to look at"), rule], findings.worst)
        return
    if not findings.worst:
        yield Heading(f"The worst frames of {focus}")
        yield Text(caption("no worst frame", variant=focus))
    rules = [caption("worst frames", variant=focus)]
    rows = (row for frame in findings.worst for row in frame.layers if row)
    if variants := list(dict.fromkeys(row[0].title.partition(":")[0] for row in rows)):
        rules.append(caption("stages of worst frames", variants=listing(variants)))
    head = [Heading(f"The worst frames of {focus}"), Text(" ".join(rules), "note")]
    if not findings.inspect:
        head.append(note("no command"))
    yield from _frames(findings, head, findings.worst)
    helped = Heading("Frames that the filter helped most", 2)
    # Harmed frames may be among the worst, which are above already.
    harmed = Heading("Further frames that the filter harmed most", 2)
    yield from _frames(findings, [helped], findings.helped)
    yield from _frames(findings, [harmed], findings.harmed)


def _frames(
    findings: Findings, head: Sequence[Block], frames: Sequence[NotableFrame]
) -> Iterator[Block]:
    """Yield frames below a heading; no page break separates it from the first frame."""
    for place, frame in enumerate(frames):
        yield KeepTogether([*(head if place == 0 else ()), *notable_frame(findings, frame)])


def reduced(frame: NotableFrame) -> NotableFrame:
    """Return a frame with pictures of the size that they have on paper, to save memory."""
    width = SMALL if frame.rates else LARGE  # without rates, people look at the masks
    layers = [[painted(image, width) for image in row] for row in frame.layers]
    return replace(frame, images=[painted(image, LARGE) for image in frame.images], layers=layers)


def notable_frame(findings: Findings, frame: NotableFrame) -> Iterator[Block]:
    """Yield a frame with its sentences, rates and pictures."""
    stamp, *facts = sentences_about(frame)
    if frame.change is not None:
        facts = [caption("changed by the filter", change=points(frame.change))]
    sentences = [Text(sentence, "note") for sentence in (stamp, " ".join(facts)) if sentence]
    title = Text(f"Frame {frame.frame}", "title")
    if frame.rates:
        rates = rates_of(frame, [*findings.facts.finals])
        yield TwoColumns([title, *sentences], [rates], 0.55)
    else:
        yield from (title, *sentences)
    images, layers = frame.images, frame.layers
    if layers and not frame.rates:  # masks are what there is to look at
        finals = [(row[0].title.partition(":")[0], row[-1]) for row in layers if row]
        images = [*images, *(replace(mask, title=f"{name}: road") for name, mask in finals)]
        layers = [row[:-1] for row in layers[:1]]
    if images:
        pictures = [(image.title, jpeg(image, LARGE)) for image in images]
        lines = -(-len(pictures) // MOST)
        yield ImageGrid(pictures, max(LEAST, -(-len(pictures) // lines)))
    columns = max((len(row) for row in layers), default=0)
    for row in layers:
        pictures = [(image.title, jpeg(image, SMALL)) for image in row]
        yield ImageGrid(pictures, columns, skip=columns - len(row))
    if findings.inspect:
        yield Command(findings.inspect(frame.frame))


def rates_of(frame: NotableFrame, variants: Sequence[str]) -> Table:
    """Tabulate the rates of each variant's final mask; ``variants`` are all scored variants."""
    rows: list[list[Cell | str]] = [
        [variant_cell(name, variants), *(percent(rates.get(rate)) for rate in SHORT)]
        for name, rates in frame.rates.items()
    ]
    return Table(["final mask, %", *SHORT], rows, small=True)


def sentences_about(frame: NotableFrame) -> Iterator[str]:
    """Yield a frame's stamp and its notes."""
    yield f"Stamp {timestamp(frame.stamp_ns)}"
    yield from frame.notes


SCRIPT_WORDS: Final = (
    "verdict of a range",
    "error of a range",
    "rates of a range",
    "worst frame",
    "rates of a threshold",
)
"""Captions that the script of a page fills in."""
LARGE_ON_PAGE: Final = 520
SMALL_ON_PAGE: Final = 300
"""Pixels across the pictures of outcomes and of layers."""
ROWS: Final = 2000
"""Greatest number of frames in the table; of a longer drive it has the frames with the highest
ERR."""


@dataclass(frozen=True, eq=False)
class ThresholdSlider:
    """A threshold on the probability of road, which a page can move."""

    variant: str
    stage: str
    now: float
    """The threshold of the run, from 0 to 1."""
    line: str
    """The lines of a configuration that set the threshold to ``{}``."""
    counts: Sequence[int]
    """TP, TN, FP and FN of the stage's masks in the run."""
    levels: Sums
    """``(2, 256)``: labelled pixels of the drive by level, non-road and road."""
    reached: bool = False
    """Whether a pixel at the threshold is road, as in masks from elsewhere."""

    def as_json(self) -> dict[str, Any]:
        """Return what the script of a page needs."""
        other, road = self.levels.tolist()
        words = {n: getattr(self, n) for n in ("stage", "now", "line", "reached")}
        return {**words, "counts": [*self.counts], "other": other, "road": road}


@dataclass(frozen=True)
class FrameBrowser(Block):
    """The frames of a drive on a page: pictures of one frame, and a table of all."""

    rows: Sequence[NotableFrame]
    """The frames of the drive, in order."""
    variants: Sequence[str]
    """The variants with rates, or without truth with signs of doubt."""
    charts: Sequence[Chart]
    """Rates along the drive."""
    command: str = ""
    """The command that opens frame ``{}`` in the viewer; empty without a recording."""
    strips: Sequence[Strip] = ()
    """Frames with their pictures, in order."""
    titles: Sequence[str] = ()
    """The rates, or without truth the signs of doubt, with a column for each variant."""
    ribbons: Sequence[Chart] = ()
    """The first rate along the drive, a low chart for each variant."""
    film: Film | None = None
    """The video of the drive; None without a recording."""
    counts: Mapping[str, Mapping[int, Sequence[int]]] = field(default_factory=dict)
    """TP, TN, FP and FN of each variant's final mask, by frame."""
    focus: str = ""
    verdicts: Mapping[str, str] = field(default_factory=dict)
    """The verdict on each variant, if it is the focus."""
    worst: Mapping[str, Sequence[int]] = field(default_factory=dict)
    """Each variant's worst frames, one a scene."""
    thresholds: Sequence[ThresholdSlider] = ()
    """The thresholds that can be moved."""

    def as_json(self) -> dict[str, Any]:
        """Return what the script of a page needs."""
        numbers = [row.frame for row in self.rows]
        return {
            "frames": numbers,
            "counts": {
                name: [by_frame.get(number) for number in numbers]
                for name, by_frame in self.counts.items()
            },
            "variants": [*self.variants],
            "focus": self.focus,
            "verdicts": {**self.verdicts},
            "worst": {**self.worst},
            "thresholds": {slider.variant: slider.as_json() for slider in self.thresholds},
            "film": self.film and self.film.as_json(),
            "colours": [label.rgba for label in ERRORS.classes],
            "words": {name: captions()[name] for name in SCRIPT_WORDS},
        }

    @property
    def pictured(self) -> frozenset[int]:
        """The frames that have pictures."""
        return frozenset(strip.frame for strip in self.strips)

    @property
    def shown(self) -> list[NotableFrame]:
        """The frames in the table: all, or of a long drive the worst and the pictured ones."""
        if len(self.rows) <= ROWS:
            return [*self.rows]
        ranked = sorted(self.rows, key=lambda row: -row.error)
        frames = self.pictured | {row.frame for row in ranked[:ROWS]}
        return [row for row in self.rows if row.frame in frames]

    def cells(self, row: NotableFrame) -> Iterator[str]:
        """Yield a frame's seconds from the first one, and a number for each column of rates."""
        yield f"{(row.stamp_ns - self.rows[0].stamp_ns) / 1e9:.2f}"
        for rate in self.titles:
            for variant in self.variants:
                yield percent(row.rates.get(variant, {}).get(rate))

    @property
    def conditions(self) -> dict[str, int]:
        """The numbers 0, 1, ... of the conditions of frames, by their words."""
        words = dict.fromkeys(words for row in self.shown for words in row.conditions)
        return {condition: place for place, condition in enumerate(words)}

    @property
    def first(self) -> int | None:
        """The frame that is shown first: the worst one with pictures; None without pictures."""
        pictured = [row for row in self.rows if row.frame in self.pictured]
        return max(pictured, key=lambda row: row.error).frame if pictured else None

    @property
    def note(self) -> str:
        """Sentences on the frames that the table, or the video, leaves out."""
        sentences, frames = [], number(len(self.rows))
        if (shown := len(self.shown)) < len(self.rows):
            file = "frames" if TESTED in self.titles else "unlabelled"
            count, rate = number(shown), self.titles[0]
            sentences.append(
                caption("frames in the table", shown=count, all=frames, rate=rate, file=file)
            )
        if self.film and len(self.film.frames) < len(self.rows):
            sentences.append(caption("filmed frames", filmed=len(self.film.frames), all=frames))
        return " ".join(sentences)


def browser(frames: FrameBrowser | None) -> Iterator[Block]:
    """Yield the section of a page that browses the frames; nothing without frames."""
    if frames and frames.rows:
        yield Heading("Frames")
        yield frames


def strip(
    frame: NotableFrame, variants: Sequence[str], command: str = "", layers: int = SMALL_ON_PAGE
) -> Strip:
    """Return a frame with its pictures, which are encoded here.

    ``variants`` are all scored variants, for their colours; ``command`` opens the frame in the
    viewer; pictures of layers are at most ``layers`` pixels across.
    """
    rows = [[_picture(image, image.title, LARGE_ON_PAGE) for image in frame.images]]
    for images in frame.layers:
        pictures, variant = [], images[0].title.partition(":")[0] if images else ""
        for place, image in enumerate(images):
            name = f"{variant}: {image.title}" if place else image.title
            # Without truth the last mask is the picture to look at.
            is_large = not frame.rates and image is images[-1]
            pictures.append(_picture(image, name, LARGE_ON_PAGE if is_large else layers))
        rows.append(pictures)
    rates = rates_of(frame, variants) if frame.rates else None
    return Strip(frame.frame, [*sentences_about(frame)], rates, rows, command)


def _picture(image: LayerImage, name: str, width: int) -> Picture:
    title = image.spec.title if image.spec else image.title
    return Picture(name, title, jpeg(image, width))
