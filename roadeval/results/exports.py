"""A fleet's results as other tools read them: flat JSON (DVC, MLflow), and JUnit XML (CI)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree

from roadeval.data import FILTERED, UNFILTERED
from roadeval.data.words import defined
from roadeval.evaluation.metrics import METRICS
from roadeval.results.facts import FleetFacts
from roadeval.results.over_drives import POOLED, DriveJudgement
from roadeval.results.schema import DAMAGED, FAILED, UNSCORED
from roadeval.runtime.text import visible


def flat_metrics(facts: FleetFacts) -> dict[str, float]:
    """Return a fleet's numbers under flat names, as ``filtered.post.ERR``.

    Rates are means over drives; ``effect.filter.post.ERR.mean`` and its likes are the differences.
    What is undefined is left out.
    """
    flat: dict[str, float | None] = {"drives": len(facts.drives), "frames": facts.frames}
    flat |= {f"drives_{status}": count for status, count in sorted(facts.counts.items())}
    for row in facts.rates:
        for name in (*METRICS, *POOLED):
            flat[f"{row['variant']}.{row['stage']}.{name}"] = row[name]
    for each in facts.effects:
        of_filter = (each.base, each.variant) == (UNFILTERED, FILTERED)
        whose = f"filter.{each.stage}" if of_filter else f"{each.base}.{each.variant}"
        begin = f"effect.{whose}.{each.metric}"
        for name in ("mean", "low", "high", "p", "pooled"):
            flat[f"{begin}.{name}"] = getattr(each, name)
    return {name: value for name, value in flat.items() if defined(value)}


def junit_xml(
    fleet: str, drives: Iterable[Mapping[str, Any]], conditions: Iterable[DriveJudgement] = ()
) -> bytes:
    """Return JUnit's XML: a case a drive, and a case a drive and condition.

    Parameters
    ----------
    fleet
        Its name.
    drives
        Rows of ``drives``. One that failed is an error, one without a score is skipped.
    conditions
        Judged on drives: where a condition holds its case fails, where it was not judged its case
        is skipped.
    """
    suite = ElementTree.Element("testsuite", name=visible(fleet))
    for row in drives:
        case = _case(suite, "replay", row["drive"], row["seconds"])
        if row["status"] == FAILED:
            _part(case, "error", row["reason"])
        elif row["status"] == UNSCORED:
            _part(case, "skipped", row["reason"])
        if row["status"] == DAMAGED:
            _part(case, "system-err", row["losses"])
        if row["verdict"]:
            _part(case, "system-out", row["verdict"])
    for judged in conditions:
        case = _case(suite, judged.condition, judged.drive, None)
        if judged.holds is not False:
            _part(case, "failure" if judged.holds else "skipped", judged.sentence)
    for name, kind in (
        ("tests", "testcase"),
        ("errors", "testcase/error"),
        ("failures", "testcase/failure"),
        ("skipped", "testcase/skipped"),
    ):
        suite.set(name, str(len(suite.findall(kind))))
    ElementTree.indent(suite)
    text: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _case(
    suite: ElementTree.Element, kind: str, drive: str, seconds: float | None
) -> ElementTree.Element:
    about = {"classname": visible(kind), "name": visible(drive)}
    if seconds is not None:
        about["time"] = f"{seconds:.3f}"
    return ElementTree.SubElement(suite, "testcase", about)


def _part(case: ElementTree.Element, kind: str, text: str | None) -> None:
    said = "\n".join(visible(line) for line in (text or "").splitlines())
    if kind.startswith("system"):
        ElementTree.SubElement(case, kind).text = said
    else:
        ElementTree.SubElement(case, kind, message=said)
