"""A history of runs: its facts, the sentences on them, and the content of its JSON file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from roadeval.data.words import counted, defined, interval, percent, points
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.evaluation.comparison.history import Line, LineChange
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import ALL
from roadeval.results.comparison import condition_of
from roadeval.results.facts import Origin
from roadeval.results.sentences import is_sure

FORMAT: Final = {"name": "roadeval-history", "version": 1}
DRIVES: Final = 20
"""Greatest number of drives of a change in the JSON file; they are the drives that changed most."""
NEAR: Final = 2
"""Greatest number of runs between steps of noisy lines that are one event."""
EXACT: Final = 1e-4
"""Noise below which equal runs give equal numbers."""


@dataclass(frozen=True)
class RunFacts:
    """A run: one result, or several that share a label."""

    paths: tuple[str, ...]
    origin: Origin
    title: str
    """The time at which it was made, or the label."""
    drives: int = 0
    frames: int = 0
    """Scored drives, and evaluated frames."""

    @property
    def name(self) -> str:
        """The title, and the commit if it is known."""
        commit, changed = self.origin.commit[:8], " with changes" if self.origin.dirty else ""
        return f"{self.title} ({commit}{changed})" if commit else self.title


@dataclass(frozen=True, eq=False)
class Event:
    """The changes of one run; the most telling change comes first."""

    run: int
    before: int
    """The last scored run before it."""
    changes: list[LineChange]
    reasons: Sequence[str] = ()
    """Differences from the run before, such as ``svm.c 1 to 2``."""
    frames: list[tuple[str, int, float]] = field(default_factory=list)
    """Drive, number and change of ERR of the frames that changed most."""

    @property
    def first(self) -> LineChange:
        """The change that stands for the others."""
        return self.changes[0]


@dataclass(frozen=True, eq=False)
class History:
    """Runs in their order, their rates, and what changed in which run."""

    runs: Sequence[RunFacts]
    lines: Sequence[Line]
    events: Sequence[Event]
    focus: str
    judgements: Sequence[Judgement]
    lost: Sequence[str]
    """Results that could not be read, and why."""

    @property
    def standing(self) -> list[Event]:
        """The events that made the focus worse and that no later run has undone."""
        events = []
        for event in self.events:
            line, step = event.first.line, event.first.step
            # Steps decide this, because single runs are noisy, and the last one may have no level.
            since = sum(s.change for s in line.steps if s.run >= step.run and s.kind != "outlier")
            is_level = (line.title, line.variant) == (TESTED, self.focus) and step.kind != "outlier"
            if is_level and event.first.difference.mean > 0 and since > step.change / 2:
                events.append(event)
        return events

    @property
    def last_good(self) -> RunFacts:
        """The newest run that was scored and that no standing event has made worse."""
        before = self.runs[: min((event.run for event in self.standing), default=len(self.runs))]
        return ([run for run in before if run.drives] or before)[-1]


def group_changes(changes: Sequence[LineChange], focus: str) -> list[Event]:
    """Return the changes of each run as one event, in which ERR of the focus comes first.

    The step of a noisy line may be found some runs early or late, so near steps are one event.
    """
    events: list[Event] = []

    def rank(change: LineChange) -> tuple[bool | float, ...]:
        line = change.line
        is_other = line.variant != focus, line.kind != ALL, line.rate != TESTED
        return *is_other, -abs(change.difference.mean)

    for change in sorted(changes, key=rank):
        near, step = NEAR if change.line.noise > EXACT else 0, change.step
        same_kind = (event for event in events if event.first.step.kind == step.kind)
        if event := next((e for e in same_kind if abs(e.run - step.run) <= near), None):
            event.changes.append(change)
        else:
            before = max(run for run in range(step.run) if defined(float(change.line.rates[run])))
            events.append(Event(step.run, before, [change]))
    return sorted(events, key=lambda event: event.run)


def describe_change(change: LineChange, when: str = "") -> str:
    """Return how much a line changed, on how many drives, and how sure that is for others."""
    difference, kind = change.difference, change.step.kind
    verb, count = ("rose", difference.worse) if difference.mean > 0 else ("fell", difference.better)
    slowly = {"drift": " slowly", "outlier": " for this run alone"}.get(kind, "")
    text = f"{change.line.title} of {change.line.variant} {verb}{slowly} by "
    text += f"{percent(abs(difference.mean))} points{when}"
    if difference.unit == "drives" and difference.units > 1:
        text += f", on {count} of {counted(difference.units, 'drive')}"
    if difference.low is None:
        return text
    others = "other drives" if difference.unit == "drives" else "other frames"
    doubt = "" if is_sure(difference) else f", which may be chance on {others}"
    return f"{text} ({interval(difference.low, difference.high)}{doubt})"


def verdict(history: History) -> str:
    """Return since when the focus is worse, or else its last change, or that nothing changed."""
    count, focus = counted(len(history.runs), "run"), history.focus
    of_focus = [event for event in history.events if event.first.line.variant == focus]
    if not of_focus:
        masks = (line for line in history.lines if (line.variant, line.kind) == (focus, ALL))
        there = max((sum(map(defined, line.rates.tolist())) for line in masks), default=0)
        if there < 2:
            return f"{focus} is in {there} of {count}, too few to show a change."
        return f"No change of {focus} in {counted(there, 'run')} is beyond chance."
    standing = history.standing
    ranked = sorted(standing, key=lambda event: -event.first.difference.mean) or [
        max(of_focus, key=lambda e: e.run)
    ]
    first = ranked[0].first
    text = describe_change(first, f" in the run of {history.runs[ranked[0].run].name}")
    parts = [c for c in ranked[0].changes if c.line.kind != ALL and c.line.variant == focus]
    sign = math.copysign(1, first.difference.mean)
    most = max(parts, key=lambda part: sign * part.difference.mean, default=first)
    if sign * most.difference.mean > 1.5 * abs(first.difference.mean):
        place = most.line.title.removeprefix(f"{most.line.rate}, ")
        text += f"; most of all: {place} ({points(most.difference.mean)})"
    text += f". Changed in that run: {'; '.join(ranked[0].reasons[:2])}"
    if not standing:
        return f"{text}. It is the last change in {count}."
    more = f", nor {counted(len(ranked) - 1, 'other rise')}" if len(ranked) > 1 else ""
    return f"{text}. No later run has undone it{more}."


def as_dict(history: History) -> dict[str, Any]:
    """Return the content of a history's JSON file."""
    return {
        "format": FORMAT,
        "verdict": verdict(history),
        "focus": history.focus,
        "last_good": history.last_good.paths,
        "runs": [asdict(run) for run in history.runs],
        "lines": [
            _address(line) | {"rates": line.rates.tolist(), "levels": line.levels.tolist()}
            for line in history.lines
        ],
        "events": [
            {
                "run": event.run,
                "sentence": describe_change(event.first),
                "reasons": event.reasons,
                "frames": event.frames,
                "changes": [
                    _address(change.line)
                    | change.step._asdict()
                    | {"difference": asdict(change.difference)}
                    | {"drives": change.drives.head(DRIVES).to_dict("records")}
                    for change in event.changes
                ],
            }
            for event in history.events
        ],
        "conditions": [condition_of(judgement) for judgement in history.judgements],
        "lost": history.lost,
    }


def _address(line: Line) -> dict[str, Any]:
    return {name: getattr(line, name) for name in ("variant", "kind", "part", "rate")}
