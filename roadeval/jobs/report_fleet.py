"""Reading the data of a fleet's report from its folder."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from roadeval.report.blocks import ImageFile
from roadeval.report.fleet.findings import FleetFindings, Row, WorstFrame
from roadeval.results.fleet.folder import Fleet
from roadeval.results.schema import ALL

TESTED: Final = "ERR"
WORST: Final = 12
"""Worst frames that are shown."""
_DRIVES: Final = [
    *("drive", "name", "group", "fold", "status", "reason", "sha256", "evaluated", "losses"),
    *("trained_on", "model", "luminance", "contrast", "shadow", "sun"),
]
_EFFECTS: Final = [
    *("drive", "base", "variant", "stage", "final", "metric"),
    *("mean", "low", "high", "p", "frames"),
]


def collect_fleet(
    fleet: Fleet, inspect: Callable[[int], str] | None = None, worst: int = WORST
) -> FleetFindings:
    """Collect what the report of a fleet is made of.

    Parameters
    ----------
    fleet
        The fleet.
    inspect
        Returns the command that opens one of the worst frames, by its rank.
    worst
        How many of these are shown, at most.

    Raises
    ------
    ResultsError
        If a table cannot be read.
    """
    drives = {row["drive"]: row for row in fleet.table("drives", _DRIVES).to_pylist()}
    counted = Counter(row["name"] for row in drives.values())
    return FleetFindings(
        name=fleet.name,
        folder=str(fleet.path),
        summary=fleet.summary,
        drives=drives,
        names={
            drive: row["name"] if counted[row["name"]] == 1 else drive
            for drive, row in drives.items()
        },
        effects=_effects(fleet),
        scores=_scores(fleet),
        worst=list(_worst(fleet, worst)),
        inspect=inspect,
    )


def _effects(fleet: Fleet) -> dict[tuple[str, str], list[Row]]:
    from pyarrow import compute

    table = fleet.table("effects", _EFFECTS)
    wanted = compute.and_(table["final"], compute.equal(table["metric"], TESTED))
    found: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in table.filter(wanted).to_pylist():
        if row["mean"] is not None:
            found[row["base"], row["variant"]].append(row)
    return dict(found)


def _scores(fleet: Fleet) -> list[Row]:
    from pyarrow import compute

    rates = fleet.summary["rates"]
    if not rates:
        return []
    columns = ["drive", "variant", "final", "region", "frames", "ERR", "FPR", "FNR", "boundary_f"]
    table = fleet.table("scores", columns)
    wanted = compute.and_(table["final"], compute.equal(table["region"], ALL))
    wanted = compute.and_(wanted, compute.equal(table["variant"], rates[0]["variant"]))
    rows: list[Row] = table.filter(wanted).to_pylist()
    return rows


def _worst(fleet: Fleet, count: int) -> Iterator[WorstFrame]:
    for rank, row in enumerate(fleet.table("worst").to_pylist()[:count], 1):
        rates = {name: row[name] for name in ("ERR", "FPR", "FNR")}
        yield WorstFrame(rank, row["drive"], row["frame"], rates, _picture(fleet.path, row))


def _picture(folder: Path, row: dict[str, Any]) -> ImageFile | None:
    """Read a picture of the folder; one from elsewhere, or of another kind, is none."""
    path = folder / (row["picture"] or "")
    if not path.resolve().is_relative_to(folder.resolve()):
        return None
    try:
        content = path.read_bytes()
    except OSError:
        return None
    whole = content.startswith(b"\xff\xd8\xff") and content.rstrip(b"\0").endswith(b"\xff\xd9")
    return ImageFile(content) if whole else None
