"""The summary of a run: ``summary.json``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.results.reading import ResultsError

FORMAT: Final = {"name": "roadeval-summary", "version": 1}
SUMMARY: Final = "summary.json"
PARTS: Final = (
    *("format", "verdict", "drive", "frames", "totals", "beyond", "difference", "oracles"),
    *("windows", "health", "training", "seconds", "warnings", "losses"),
    *("selection", "settings", "run", "versions", "log", "tables"),
)
"""The parts of the summary, in the file's order. Readers must do without the `LATER` ones."""
LATER: Final = frozenset({"run", "tables"})
"""Parts that earlier versions did not write."""


def summary_text(parts: Mapping[str, Any]) -> str:
    """Write a summary as JSON; undefined numbers become null.

    Raises
    ------
    ValueError
        If a part is unknown or missing (see `PARTS`; ``format`` is added here).
    """
    document = {"format": FORMAT} | dict(parts)
    if wrong := (document.keys() ^ set(PARTS)) - (LATER - document.keys()):
        raise ValueError(f"summary: unknown or missing {sorted(wrong)}")
    ordered = {name: plain(document[name]) for name in PARTS if name in document}
    return json.dumps(ordered, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def read_summary(path: Path) -> dict[str, Any]:
    """Read ``summary.json``.

    Raises
    ------
    ResultsError
        If there is none, or it is damaged or of another format.
    """
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultsError(
            f"{path.parent}: no results here ({SUMMARY}: {error.strerror}); "
            "make some with roadeval replay"
        ) from error
    except ValueError as error:
        raise ResultsError(f"{path}: not a summary ({error}); make it anew") from error
    if not isinstance(summary, dict) or summary.get("format") != FORMAT:
        raise ResultsError(
            f"{path}: not a summary of format {FORMAT['name']} {FORMAT['version']}; "
            "make it anew with this version of roadeval replay"
        )
    return summary


def plain(value: Any) -> Any:
    """Turn mappings, sequences, paths and undefined numbers into what JSON has."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
