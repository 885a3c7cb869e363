"""The verdict on a fleet, in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from roadeval.data.words import in_percent, plain_points
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.certainty import Degree, degree

RATE: Final = "ERR"
NOTHING: Final = "Nothing to tell: no drive of the fleet was scored."


def verdict_of(summary: Mapping[str, Any], settings: EvaluationSettings) -> str:
    """Return the verdict: what the filter changes over all drives, or a variant against blind.

    Parameters
    ----------
    summary
        With the parts ``effects`` and ``rates`` of ``fleet.json``.
    settings
        What is negligible.
    """
    tested = [each for each in summary["effects"] if each["metric"] == RATE]
    filters = [each for each in tested if each["kind"] == "filter"]
    if found := next(iter(filters), None):
        return sentence(found, "the filter", settings)
    blind = [each for each in tested if each["kind"] == "blind" and each["drives"]]
    if blind:
        found = min(blind, key=lambda each: float(each["mean"]))
        return sentence(found, f"{found['variant']} instead of {found['base']}", settings)
    if summary["rates"]:
        first = summary["rates"][0]
        return (
            f"{RATE} of {first['variant']} is {_percent(first[RATE])} % on average over "
            f"{_drives(first['drives'])}; there is nothing to compare it with."
        )
    return NOTHING


def sentence(found: Mapping[str, Any], what: str, settings: EvaluationSettings) -> str:
    """Return what a difference over drives tells.

    Parameters
    ----------
    found
        As `roadeval.evaluation.drives.AcrossDrives`, with ``stage`` and ``metric``.
    what
        Brings it about, as ``the filter``.
    settings
        What is negligible.
    """
    over, rate = _drives(found["drives"]), f"{found['metric']} of {found['stage']}"
    if found["clusters"] < found["drives"]:
        over += f" in {found['clusters']} group{'s' * (found['clusters'] != 1)}"
    counted = f"worse on {found['worse']}, better on {found['better']}"
    mean, low, high = (found[name] for name in ("mean", "low", "high"))
    verb, size = ("raises" if (mean or 0) > 0 else "lowers"), _percent(abs(mean or 0))
    bound = "" if low is None else _percent(max(-low, high))
    ends = "" if low is None else f"between {plain_points(low)} and {plain_points(high)} pp"
    sizes = "" if low is None else _sizes(mean, low, high)
    return {
        Degree.UNDEFINED: f"Nothing to compare: no drive has {rate} with and without {what}.",
        Degree.FEW: (
            f"{over} are too few to tell of others ({found['clusters_needed']} are needed): "
            f"{what} changes {rate} by {plain_points(mean or 0)} pp on average, {counted}."
        ),
        Degree.SAME: f"Over {over} {what} leaves {rate} of every drive as it is.",
        Degree.SURE: f"Over {over} {what} {verb} {rate} by {size} pp {sizes}: {counted}.",
        Degree.LITTLE: (
            f"Over {over} {what} has no effect on {rate} larger than {bound} pp: {counted}."
        ),
        Degree.PROBABLE: (
            f"Over {over} {what} probably {verb} {rate}, by {size} pp ({ends}): {counted}."
        ),
        Degree.UNKNOWN: (
            f"Cannot tell over {over} whether {what} changes {rate}: by {ends} "
            f"({plain_points(mean or 0)} on average), {counted}."
        ),
    }[_degree(found, settings)]


def _sizes(mean: float, low: float, high: float) -> str:
    """Return an interval of the change's size, in its direction."""
    ends = (low, high) if mean > 0 else (-high, -low)
    return f"[{', '.join(map(_percent, ends))}]"


def _degree(found: Mapping[str, Any], settings: EvaluationSettings) -> Degree:
    low, high, p = (found[name] for name in ("low", "high", "p"))
    confidence, negligible = found["confidence"], settings.negligible
    return degree(found["drives"], low, high, p, confidence=confidence, negligible=negligible)


def _drives(count: int) -> str:
    return f"{count} drive{'' if count == 1 else 's'}"


def _percent(fraction: float) -> str:
    return f"{in_percent(fraction):.2f}"
