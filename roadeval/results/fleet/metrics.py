"""A fleet's results as other tools read them: flat JSON (DVC, MLflow), and JUnit XML (CI)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree

from roadeval.data import FILTERED, UNFILTERED
from roadeval.evaluation.metrics import METRICS
from roadeval.results.fleet.conditions import DriveJudgement
from roadeval.results.fleet.record import DAMAGED, FAILED, UNSCORED
from roadeval.runtime.text import visible


def flat_metrics(summary: Mapping[str, Any]) -> dict[str, float]:
    """Return a fleet's numbers under flat names, as ``filtered.post.ERR``.

    Rates are means over drives; ``effect.filter.post.ERR.mean`` and its likes are the differences.
    What is undefined is left out.

    Parameters
    ----------
    summary
        The content of ``fleet.json``.
    """
    flat: dict[str, float] = {"drives": len(summary["drives"]), "frames": summary["frames"]}
    flat |= {f"drives_{status}": count for status, count in sorted(summary["counts"].items())}
    for row in summary["rates"]:
        for name in (*METRICS, *(f"pooled_{name}" for name in METRICS)):
            flat[f"{row['variant']}.{row['stage']}.{name}"] = row[name]
    for each in summary["effects"]:
        of_filter = (each["base"], each["variant"]) == (UNFILTERED, FILTERED)
        whose = f"filter.{each['stage']}" if of_filter else f"{each['base']}.{each['variant']}"
        begin = f"effect.{whose}.{each['metric']}"
        flat |= {f"{begin}.{name}": each[name] for name in ("mean", "low", "high", "p", "pooled")}
    return {name: value for name, value in flat.items() if value is not None and _finite(value)}


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


def _finite(value: float) -> bool:
    return math.isfinite(value)
