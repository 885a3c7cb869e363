"""A drive's row of its fleet's table of drives."""

from __future__ import annotations

from typing import Any, Final

from roadeval.fleet.entry import DriveEntry
from roadeval.jobs.replay import Outcome
from roadeval.results.fleet.record import DAMAGED, FAILED, SCORED, UNSCORED

LOST: Final = 3
"""Exit code of a replay that has lost a part of its log."""


def drive_row(outcome: Outcome, entry: DriveEntry) -> dict[str, Any]:
    """Return the row of a drive that was replayed."""
    summary = outcome.summary
    scored = bool(summary["totals"])
    status = (DAMAGED if outcome.losses else SCORED) if scored else UNSCORED
    missing = next((w for w in outcome.warnings if not scored), None)
    known = {name: summary["drive"][name] for name in ("rate_hz", "width", "height")}
    counted = ("in_log", "read", "decoded", "labelled", "trained_on", "evaluated")
    return {
        "name": entry.name,
        "source": entry.shown,
        "status": status,
        "exit_code": LOST if outcome.losses else 0,
        "reason": missing,
        "sha256": summary["log"]["sha256"],
        **known,
        **{name: summary["frames"][name] for name in counted},
        "losses": "\n".join(outcome.losses) or None,
        "warnings": "\n".join(outcome.warnings) or None,
        "verdict": summary["verdict"],
    }


def failed_row(entry: DriveEntry, reason: str, exit_code: int, attempts: int) -> dict[str, Any]:
    """Return the row of a drive that could not be used."""
    return {
        "name": entry.name,
        "source": entry.shown,
        "status": FAILED,
        "exit_code": exit_code,
        "reason": reason,
        "attempts": attempts,
    }
