"""A comparison for people and machines: sentences, the content of its JSON file, and JUnit XML."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from itertools import groupby
from typing import Any, Final
from xml.etree import ElementTree

from roadeval.data.words import listing, percent, plain_points, setting
from roadeval.evaluation.comparison.compare import FALSE_DISCOVERY_RATE, Comparison, MaskChange
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.stats.difference import Difference
from roadeval.results.sentences import is_significant, is_sure
from roadeval.results.verdict import describe_change
from roadeval.runtime.text import visible

FORMAT: Final = {"name": "roadeval-comparison", "version": 2}
NAMED: Final = 5
"""Number of changed settings that a screen names."""


def as_dict(comparison: Comparison, judgements: Sequence[Judgement] = ()) -> dict[str, Any]:
    """Return the content of a comparison's JSON file: its facts, and the sentences on them."""
    return {
        "format": FORMAT,
        "changed": changed_settings(comparison),
        "verdict": verdict(comparison),
        "where": where(comparison),
        **asdict(comparison),
        "false_discovery_rate": FALSE_DISCOVERY_RATE,
        "conditions": [*map(condition_of, judgements)],
    }


def condition_of(judgement: Judgement) -> dict[str, Any]:
    """Return a judged condition as a JSON file has it."""
    facts = {name: value for name, value in vars(judgement).items() if name != "why"}
    return {**vars(facts.pop("condition")), **facts, "sentence": describe_judgement(judgement)}


def changed_settings(comparison: Comparison, most: int | None = None) -> list[str]:
    """Return a line for each new result on the settings in which it differs from the base.

    ``most`` limits the number of settings that are named; by default all are named.
    """
    lines = []
    for label, settings in comparison.changed_settings.items():
        # Code and networks that a user brought come first.
        names = sorted(settings, key=lambda name: not name.startswith(("code of ", "network ")))
        pairs = [(name, *map(setting, settings[name])) for name in names]
        named = [f"{name} {before} to {after}" for name, before, after in pairs]
        more = f"; and {len(named) - most} more" if most and len(named) > most else ""
        suffix = f" in {label}" if len(comparison.results) > 2 else ""
        lines.append(f"Changed settings{suffix}: {'; '.join(named[:most])}{more}.")
    return lines


def verdict(comparison: Comparison) -> str:
    """Return what changed in the final masks, and how sure that is."""
    finals = comparison.finals()
    base = comparison.results[0].label
    several = len({change.variant for change in finals}) > 1
    changed = [change for change in finals if not change.unchanged] or finals[:1]
    parts = []
    for change in changed:
        new = _mask_name(change.result, change.variant) if several else change.result
        error = change.difference[TESTED]
        parts.append(describe_change(error, new, base, (change.base, change.new)))
    return " ".join([*parts, *unchanged(comparison, [c for c in finals if c not in changed])])


def unchanged(comparison: Comparison, masks: Iterable[MaskChange]) -> Iterator[str]:
    """Yield a sentence for each result on its masks that did not change."""
    base = comparison.results[0].label
    for result, rows in groupby(masks, lambda row: row.result):
        names = dict.fromkeys(row.variant for row in rows)
        suffix = "" if [*names] == [result] else f" of {result}"
        yield f"{listing([*names])}{suffix}: every frame as in {base}."


def where(comparison: Comparison) -> list[str]:
    """Return where final masks are surely better or worse: regions, frames and drives."""
    still = {(mask.result, mask.variant) for mask in comparison.finals() if mask.unchanged}
    masks = dict.fromkeys((row.result, row.variant) for row in comparison.regions)
    sentences = []
    for mask in [mask for mask in masks if mask not in still]:
        regions = [row for row in comparison.regions if (row.result, row.variant) == mask]
        sure, parts = [row for row in regions if is_significant(row.difference)], []
        for word, sign in (("better", -1), ("worse", 1)):
            titles = [row.title for row in sure if sign * row.difference.mean > 0]
            if len(titles) == len(regions):
                parts.append(f"{word} everywhere")
            elif titles:
                parts.append(f"{word} ({'; '.join(titles)})")
        changes = ", ".join(parts) or why_unsure(row.difference for row in regions)
        sentences.append(f"{_mask_name(*mask)} by region: {changes}")
    base = comparison.results[0].label
    for mask, rows in groupby(comparison.classes, lambda row: (row.result, row.variant)):
        parts = [
            f"{percent(row.new, 0)} % {row.name} ({percent(row.base, 0)} % in {base})"
            for row in rows
            if max(row.new, row.base) >= 0.1
        ]
        sentences.append(f"{_mask_name(*mask)}: the false road is {', '.join(parts)}")
    for result, frames in groupby(comparison.disagreements, lambda frame: frame.result):
        first, *rest = frames
        most = percent(first.base_right + first.new_right, 1)
        named = [f"{first.frame} ({most} % of the pixels)", *(str(frame.frame) for frame in rest)]
        sentences.append(f"{result} disagrees most on frames {', '.join(named)}")
    return [*sentences, *changed_drives(comparison)]


def why_unsure(differences: Iterable[Difference]) -> str:
    """Return why none of the differences of several regions is sure; empty if one is.

    >>> change = Difference(0.08, 0.001, 0.16, 0.04, 0.95, "frames", 90, p_holm=0.5, comparisons=12)
    >>> why_unsure([change])
    'each change may be chance, as 12 regions are compared'
    """
    changes = list(differences)
    if any(map(is_significant, changes)):
        return ""
    lacking = [change for change in changes if change.low is None]
    if len(lacking) == len(changes):  # a region that fewer frames or drives have says less
        most = max(lacking, key=lambda change: change.units, default=None)
        return f"no interval, as {most.none_because}" if most else ""
    uncorrected = [change for change in changes if is_sure(replace(change, p_holm=None))]
    counts = [change.comparisons for change in uncorrected if change.comparisons]
    family = f", as {max(counts)} regions are compared" if counts else ""
    return f"each change may be chance{family}"


def _mask_name(result: str, variant: str) -> str:
    return result if result == variant else f"{variant} of {result}"


def changed_drives(comparison: Comparison) -> list[str]:
    """Return a line for each final mask: on how many drives it changed, and in which direction."""
    lines = []
    for mask in dict.fromkeys((row.result, row.variant) for row in comparison.drives):
        drives = [row for row in comparison.drives if (row.result, row.variant) == mask]
        tested = sum(row.q is not None for row in drives)
        changed = [row for row in drives if row.changed]
        worse = sum(row.difference.mean > 0 for row in changed)
        lines.append(
            f"{_mask_name(*mask)}: {TESTED} surely changed on {len(changed)} of {tested} drives "
            f"(worse on {worse}, better on {len(changed) - worse}; false discovery rate "
            f"{percent(FALSE_DISCOVERY_RATE, 0)} %)"
        )
    return lines


def describe_judgement(judgement: Judgement) -> str:
    """Return a sentence on the value that a condition limits."""
    condition, drives = judgement.condition, judgement.drives
    if judgement.holds is None:
        return judgement.why
    rate = f"{condition.stage}.{condition.variant}.{condition.rate} of {judgement.result}"
    limit = f"(limit: {condition.text})"
    after, over = f"{percent(judgement.after)} %", f" over {drives} drives" if drives > 1 else ""
    if not condition.is_change:
        return f"{rate} is {after}{over} {limit}"
    change = f"{plain_points(judgement.value)} points"
    if condition.surely:
        change += f" [{plain_points(judgement.low)}, {plain_points(judgement.high)}]"
    before = f"{percent(judgement.before)} %"
    return f"{rate} changed by {change}{over}, from {before} to {after} {limit}"


def headline(holds: Sequence[bool | None]) -> str:
    """Return whether all limits were kept; ``holds`` has the values of `Judgement.holds`."""
    if all(exceeded is False for exceeded in holds):
        return f"passed, {len(holds)} limit{'s' * (len(holds) > 1)} kept"
    counts = {"exceeded": holds.count(True), "not judged": holds.count(None)}
    parts = [f"{count} of {len(holds)} limits {word}" for word, count in counts.items() if count]
    return f"failed, {listing(parts)}"


DISCOVERY: Final = (
    f"On average at most {percent(FALSE_DISCOVERY_RATE, 0)} % of the drives that are called "
    "changed are not (Benjamini and Hochberg's correction over the drives; q is the p-value after "
    "it)."
)


def junit_xml(comparison: Comparison, judgements: Iterable[Judgement]) -> bytes:
    """Return JUnit's XML, as CI systems read it.

    One case tells what changed. There is another for each condition and result, which is a failure
    if the condition holds, and an error if it could not be judged.
    """
    labels = ", ".join(result.label for result in comparison.results)
    lines = [*changed_settings(comparison), verdict(comparison), *where(comparison)]
    cases = [("compare", labels, "system-out", lines)]
    for judgement in judgements:
        kind = {True: "failure", False: "system-out", None: "error"}[judgement.holds]
        texts = describe_judgement(judgement).splitlines()
        cases.append((judgement.condition.text, judgement.result, kind, texts))
    suite = ElementTree.Element("testsuite", name=visible(labels))
    for what, name, kind, texts in cases:
        about = {"classname": visible(what), "name": visible(name)}
        part = ElementTree.SubElement(ElementTree.SubElement(suite, "testcase", about), kind)
        text = "\n".join(map(visible, texts))
        if kind == "system-out":
            part.text = text
        else:
            part.set("message", text)
    suite.set("tests", str(len(cases)))
    for count in ("error", "failure"):
        suite.set(f"{count}s", str(len(suite.findall(f"testcase/{count}"))))
    ElementTree.indent(suite)
    xml: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"
