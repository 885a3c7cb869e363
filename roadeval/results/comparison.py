"""A comparison for people and machines: sentences, the content of its JSON file, and JUnit XML."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from typing import Any, Final
from xml.etree import ElementTree

from roadeval.data.words import first_of, listing, percent, plain_points
from roadeval.evaluation.comparison import FALSE, Change, Comparison, Judgement, Kind, Note
from roadeval.evaluation.score import TESTED
from roadeval.results.sentences import is_significant, levels, sentence
from roadeval.runtime.text import visible

FORMAT: Final = {"name": "roadeval-comparison", "version": 2}
NAMED: Final = 5
"""Drives of those left out for one reason, and settings that changed, which are named."""


def as_dict(comparison: Comparison, judgements: Sequence[Judgement] = ()) -> dict[str, Any]:
    """Return the content of a comparison's JSON file: its facts, and the sentences on them."""
    facts = asdict(comparison)
    drives = [
        {**fact, "changed": row.changed}
        for row, fact in zip(comparison.drives, facts.pop("drives"), strict=True)
    ]
    return {
        "format": FORMAT,
        "changed": changed_settings(comparison),
        "verdict": verdict(comparison),
        "where": where(comparison),
        **facts,
        "drives": drives,
        "false_discovery_rate": FALSE,
        "warnings": warnings(comparison),
        "conditions": [_condition(each) for each in judgements],
    }


def _condition(judgement: Judgement) -> dict[str, Any]:
    fact = {k: value for k, value in asdict(judgement).items() if k != "why"}
    return {**fact.pop("condition"), **fact, "sentence": judged(judgement)}


def changed_settings(comparison: Comparison, most: int | None = None) -> list[str]:
    """Return the settings that new results do not share with the base, a line a result.

    With ``most`` only the first so many are named.
    """
    lines = []
    for each in comparison.changed_settings:
        named = [f"{name} {_value(a)} to {_value(b)}" for name, (a, b) in each.settings.items()]
        more = f"; and {len(named) - most} more" if most and len(named) > most else ""
        of = f" in {each.other}" if len(comparison.results) > 2 else ""
        lines.append(f"Changed settings{of}: {'; '.join(named[:most])}{more}.")
    return lines


def verdict(comparison: Comparison) -> str:
    """Return what changed in the final masks, and how sure that is."""
    if not comparison.paired:
        return "Different drives, side by side: no difference is given."
    finals = comparison.finals()
    base = comparison.results[0].label
    several = len({change.variant for change in finals}) > 1
    changed = [change for change in finals if not change.unchanged] or finals[:1]
    parts = [_sentence(change, base, comparison, several=several) for change in changed]
    return " ".join([*parts, *unchanged(comparison, [c for c in finals if c not in changed])])


def unchanged(comparison: Comparison, masks: Iterable[Change]) -> Iterator[str]:
    """Yield the masks that are as they were, a sentence a result."""
    base = comparison.results[0].label
    for result, rows in groupby(masks, lambda row: row.result):
        names = dict.fromkeys(row.variant for row in rows)
        of = "" if [*names] == [result] else f" of {result}"
        yield f"{listing([*names])}{of}: every frame as in {base}."


def _sentence(change: Change, base: str, comparison: Comparison, *, several: bool) -> str:
    what = f"{change.result} instead of {base}"
    rate = f"{TESTED} of {change.stage}"
    found = change.difference[TESTED]
    ends = levels(found, change.base, change.new)
    told = sentence(found, what, rate, comparison.settings, levels=ends)
    if change.result == change.variant or not several:
        return told
    return f"{change.variant}: {told[0].lower()}{told[1:]}"


def where(comparison: Comparison) -> list[str]:
    """Return where final masks are surely better or worse: regions, frames and drives."""
    still = {(each.result, each.variant) for each in comparison.finals() if each.unchanged}
    masks = dict.fromkeys((row.result, row.variant) for row in comparison.regions)
    masks = {mask: None for mask in masks if mask not in still}
    return [
        *(_by_region(comparison, *mask) for mask in masks),
        *_disagreements(comparison),
        *changed_drives(comparison),
    ]


def _by_region(comparison: Comparison, result: str, variant: str) -> str:
    rows = [r for r in comparison.regions if (r.result, r.variant) == (result, variant)]
    sure = [r for r in rows if is_significant(r.difference.p_holm, r.difference.confidence)]
    parts = []
    for word, sign in (("better", -1), ("worse", 1)):
        names = [r.title for r in sure if sign * r.difference.mean > 0]
        if len(names) == len(rows):
            parts.append(f"{word} everywhere")
        elif names:
            parts.append(f"{word} ({'; '.join(names)})")
    told = ", ".join(parts) or "no change is sure in any"
    shade = "" if comparison.drives else " and shade"
    return f"{_whose(result, variant)} by region{shade}: {told}"


def _whose(result: str, variant: str) -> str:
    return result if result == variant else f"{variant} of {result}"


def _disagreements(comparison: Comparison) -> Iterator[str]:
    for result in dict.fromkeys(each.result for each in comparison.disagreements):
        first, *rest = (each for each in comparison.disagreements if each.result == result)
        most = percent(first.base_right + first.new_right, 1)
        frames = [f"{first.frame} ({most} % of the pixels)", *(str(each.frame) for each in rest)]
        yield f"{result} disagrees most on frames {', '.join(frames)}"


def changed_drives(comparison: Comparison) -> list[str]:
    """Return on how many single drives each final mask changed, and in which direction."""
    lines = []
    for mask in dict.fromkeys((row.result, row.variant) for row in comparison.drives):
        own = [row for row in comparison.drives if (row.result, row.variant) == mask]
        tested = sum(row.q is not None for row in own)
        changed = [row for row in own if row.changed]
        worse = sum(row.difference.mean > 0 for row in changed)
        lines.append(
            f"{_whose(*mask)}: {TESTED} surely changed on {len(changed)} of {tested} drives "
            f"(worse on {worse}, better on {len(changed) - worse}; false discovery rate "
            f"{percent(FALSE, 0)} %)"
        )
    return lines


def warnings(comparison: Comparison) -> list[str]:
    """Return what was left out and what makes results less comparable than they look."""
    return [_told(each) for each in comparison.notes]


def _told(note: Note) -> str:
    one, other, count = note.result, note.other, note.count
    drives = "1 drive is" if count == 1 else f"{count} drives are"
    names = first_of(note.names, NAMED)
    settings = ", ".join(
        f"`{name}` {_value(a)} and {_value(b)}" for name, (a, b) in note.settings.items()
    )
    guess = "" if note.settings else " (other labels or topics?)"
    if note.kind is Kind.LOG_UNKNOWN and not note.names:
        return f"{one} does not say which log it is of: nothing is subtracted"
    return {
        Kind.ABSENT: f"{drives} left out of {one} (not in {other}): {names}",
        Kind.UNSCORED: f"{drives} left out of {one} (not scored in both): {names}",
        Kind.OTHER_LOG: f"{drives} left out of {one} (of another log in {other}): {names}",
        Kind.NO_FRAME: (
            f"{drives} left out of {one} (no evaluated frame in common with {other}): {names}"
        ),
        Kind.LOG_UNKNOWN: f"{drives} left out of {one} (log unknown): {names}",
        Kind.SAME_LOGS: (
            f"{count} drives have other names in {one} and {other}, and are taken for the same by "
            "the digests of their logs"
        ),
        Kind.FRAMES: (
            f"{count} frames that {one} evaluated are left out against {other}, which lacks them "
            "or trained on them"
        ),
        Kind.VARIANT: f"{names} is left out: {one} and {other} share no frame of it",
        Kind.SETTINGS: (
            f"{one} and {other} were replayed with different settings ({settings}): part of the "
            "change may be theirs"
        ),
        Kind.TRUTH: (
            f"the truth differs on {count} frames between {one} and {other}{guess}: part of the "
            "change may be the truth's"
        ),
        Kind.OTHER_DRIVES: (
            f"{one} and {other} are of different drives: side by side only, for a difference "
            "would mix the scene with the method"
        ),
        Kind.END_MISSING: f"{one} is a partial recording: the end of its drive is missing",
    }[note.kind]


def judged(judgement: Judgement) -> str:
    """Return what was found of a condition, and whether it holds."""
    condition, drives = judgement.condition, judgement.drives
    if judgement.holds is None:
        return judgement.why
    rate = f"{condition.stage}.{condition.variant}.{condition.rate} of {judgement.result}"
    holds = "holds" if judgement.holds else "does not hold"
    after, over = f"{percent(judgement.after)} %", f" over {drives} drives" if drives > 1 else ""
    if not condition.is_change:
        return f"{rate} is {after}{over}: {condition.text} {holds}"
    change = f"{plain_points(judgement.value)} pp"
    if condition.surely:
        change += f" [{plain_points(judgement.low)}, {plain_points(judgement.high)}]"
    before = f"{percent(judgement.before)} %"
    return f"{rate} changed by {change}{over} ({before} to {after}): {condition.text} {holds}"


def headline(holds: Sequence[bool | None]) -> str:
    """Return whether limits were kept: of each whether it was exceeded, None if not judged."""
    if not any(each is not False for each in holds):
        return f"passed, {len(holds)} limit{'s' * (len(holds) > 1)} kept"
    counts = {"exceeded": holds.count(True), "not judged": holds.count(None)}
    found = [f"{count} of {len(holds)} limits {word}" for word, count in counts.items() if count]
    return f"failed, {listing(found)}"


def discovery_note() -> str:
    """Return what it means that a drive is called changed."""
    return (
        f"Of the drives that are called changed, at most {percent(FALSE, 0)} % on average are not "
        "(Benjamini and Hochberg's correction over the drives; q is the p-value after it)."
    )


def _value(value: Any) -> str:
    """Write a setting's value for a person."""
    if value is None or value in ({}, [], ()):
        return "not given"
    if isinstance(value, dict):
        return ", ".join(f"{name}={each}" for name, each in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class Case:
    """A case of a JUnit file."""

    kind: str
    """What was done, or the condition that was judged."""
    name: str
    """The drive or the result."""
    parts: Mapping[str, str | None] = field(default_factory=dict)
    """Texts by JUnit's elements: ``error``, ``failure``, ``skipped``, ``system-out``."""


def comparison_cases(comparison: Comparison, judgements: Iterable[Judgement]) -> Iterator[Case]:
    """Yield a case with what changed, and one a condition and result, which fails if it holds.

    One that could not be judged is an error.
    """
    labels = ", ".join(each.label for each in comparison.results)
    lines = [*changed_settings(comparison), verdict(comparison), *where(comparison)]
    yield Case("compare", labels, {"system-out": "\n".join(lines)})
    for each in judgements:
        kind = {True: "failure", False: "system-out", None: "error"}[each.holds]
        yield Case(each.condition.text, each.result, {kind: judged(each)})


def junit_xml(name: str, cases: Iterable[Case]) -> bytes:
    """Return JUnit's XML of a suite, as CI systems read it."""
    suite = ElementTree.Element("testsuite", name=visible(name))
    for case in cases:
        about = {"classname": visible(case.kind), "name": visible(case.name)}
        element = ElementTree.SubElement(suite, "testcase", about)
        for kind, text in case.parts.items():
            said = "\n".join(visible(line) for line in (text or "").splitlines())
            if kind.startswith("system"):
                ElementTree.SubElement(element, kind).text = said
            else:
                ElementTree.SubElement(element, kind, message=said)
    for count, kind in (
        ("tests", "testcase"),
        ("errors", "testcase/error"),
        ("failures", "testcase/failure"),
        ("skipped", "testcase/skipped"),
    ):
        suite.set(count, str(len(suite.findall(kind))))
    ElementTree.indent(suite)
    xml: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"
