"""The summary of a run: ``summary.json``."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.results.tables import ResultsError
from roadeval.runtime.documents import LONGEST, read_bounded, read_json
from roadeval.runtime.text import elided, visible, visible_lines

FORMAT: Final[Mapping[str, Any]] = {"name": "roadeval-summary", "version": 4}
SUMMARY: Final = "summary.json"
PARTS: Final = (
    *("format", "verdict", "drive", "frames", "totals", "beyond", "curves", "difference"),
    *("against_unfiltered", "against_blind", "seeds", "oracles", "windows", "claims", "health"),
    *("examples", "training", "seconds", "warnings", "losses", "run", "settings", "methods"),
    *("versions", "log", "masks", "tables", "files", "digest"),
)
"""The parts of the summary, in the file's order."""
OPTIONAL: Final = frozenset({"curves", "seeds", "examples", "methods", "masks", "tables", "files"})
"""Parts that not every summary has: a recording has no files, and most runs train with one seed,
have no network, and all masks in the log."""
RESULTS: Final = (
    *("verdict", "frames", "totals", "beyond", "curves", "difference"),
    *("against_unfiltered", "against_blind", "seeds"),
    *("oracles", "windows", "claims", "health", "warnings", "losses", "settings", "methods"),
)
"""Parts that tell what came out and by which method, of which ``digest`` holds a checksum. Whoever
moves or renames files may mend what the others say of them."""
VALUES: Final = 200_000
"""Values that are read of a summary; a run with two variants writes some two thousand."""
ALTERED: Final = "its content is not what was written"
_LEVELS: Final = {
    **dict.fromkeys(("drive", "frames", "training", "run", "versions", "log"), 1),
    **dict.fromkeys(("beyond", "claims", "health", "seconds", "settings", "tables"), 2),
    **dict.fromkeys(("totals", "difference", "against_unfiltered"), 3),
    **dict.fromkeys(("against_blind", "seeds", "oracles"), 3),
}
"""Parts that are mappings, and how many levels of mappings they are at least."""


def digest_of(content: Mapping[str, Any], parts: Iterable[str]) -> dict[str, Any]:
    """Return the ``digest`` of a JSON document: which parts it covers, and their SHA-256."""
    covered = [part for part in parts if part in content]
    told = json.dumps(
        {part: plain(content[part]) for part in covered}, allow_nan=False, sort_keys=True
    )
    return {"parts": covered, "sha256": hashlib.sha256(told.encode()).hexdigest()}


def is_as_written(content: Mapping[str, Any]) -> bool:
    """Return whether a document agrees with its ``digest``."""
    try:
        stated = content["digest"]
        return bool(stated == digest_of(content, stated["parts"]))
    except (TypeError, KeyError):  # the digest is damaged
        return False


def summary_text(parts: Mapping[str, Any]) -> str:
    """Write a summary as JSON; undefined numbers become null.

    Raises
    ------
    ValueError
        If a part is unknown or missing (see `PARTS`; ``format`` and ``digest`` are added here).
    """
    document = {"format": FORMAT} | dict(parts) | {"digest": digest_of(parts, RESULTS)}
    if wrong := (document.keys() ^ set(PARTS)) - (OPTIONAL - document.keys()):
        raise ValueError(f"summary: unknown or missing {sorted(wrong)}")
    ordered = {name: plain(document[name]) for name in PARTS if name in document}
    return json_text(ordered)


def read_summary(path: Path) -> dict[str, Any]:
    """Read ``summary.json``.

    Raises
    ------
    ResultsError
        If there is none, or it is damaged or of another format.
    """
    try:
        text = read_bounded(path).decode()
    except OSError as error:
        raise ResultsError(
            f"{path.parent}: no results here ({SUMMARY}: {error.strerror}); "
            "make some with roadeval replay"
        ) from error
    except ValueError as error:
        raise ResultsError(f"{path}: not a summary ({error}); make it anew") from error
    summary = parse_summary(text, path)
    if missing := {"drive", "frames", "totals"} - summary.keys():
        raise ResultsError(f"{path}: not a summary (it has no {', '.join(sorted(missing))})")
    return summary


def parse_summary(text: str, where: object) -> dict[str, Any]:
    """Read the text of a summary.

    Raises
    ------
    ResultsError
        If it is damaged or of another format. ``where`` begins the message.
    """
    try:
        summary = read_json(text, VALUES)
    except ValueError as error:
        raise ResultsError(f"{where}: not a summary ({error}); make it anew") from error
    form = summary.get("format") if isinstance(summary, dict) else None
    number = form.get("version") if isinstance(form, dict) else None
    if not isinstance(number, int) or form != {**FORMAT, "version": number}:
        raise ResultsError(f"{where}: not a summary of roadeval; make it anew with roadeval replay")
    if number != FORMAT["version"] or "digest" not in summary:
        versions = summary.get("versions")
        made_by = versions.get("roadeval") if isinstance(versions, dict) else None
        sentence = another_format(made_by, later=number > FORMAT["version"])
        raise ResultsError(f"{where}: {sentence}")
    for part in summary.keys() & _LEVELS.keys():
        if not _is_mapping(summary[part], _LEVELS[part]):
            raise ResultsError(f"{where}: damaged (`{part}` is not what it must be)")
    if not is_as_written(summary):
        raise ResultsError(f"{where}: damaged ({ALTERED}); make it anew with roadeval replay")
    return dict(summary)


def another_format(version: object, *, later: bool) -> str:
    """Return a sentence on results of another format, with the version that wrote them if known."""
    if later:
        made = (
            f"roadeval {visible(str(version))}, a later version" if version else "a later version"
        )
        return f"made by {made}: update roadeval"
    made = f"roadeval {visible(str(version))}" if version else "an earlier version of roadeval"
    return f"made by {made}, whose format is read no more: replay the log again"


def _is_mapping(value: Any, levels: int) -> bool:
    """Return whether a value is a mapping, and its values are, so many levels down."""
    return isinstance(value, dict) and (
        levels == 1 or all(_is_mapping(each, levels - 1) for each in value.values())
    )


def json_text(value: Any) -> str:
    """Write what JSON has as a document of it; what cannot be seen in a text is escaped."""
    return visible_lines(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def plain(value: Any) -> Any:
    """Turn mappings, sequences, paths and undefined numbers into what JSON has.

    A text of any length, as of a topic's name, is shortened to what is read again.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    value = str(value) if isinstance(value, Path) else value
    return elided(value, LONGEST) if isinstance(value, str) and len(value) > LONGEST else value
