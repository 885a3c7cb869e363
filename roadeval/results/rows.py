"""Rows of the tables, and their text in CSV.

Numbers are written so that they read back the same. An undefined rate is an empty cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from roadeval.data import BASELINE, Doubt, Frame, FrameResult, Tally, TruthClass
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score.thresholds import at_levels
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.evaluation.stats.slices import OF_REGIONS
from roadeval.evaluation.tables import KEY, MASK, concatenate, group_rows, is_final, totals
from roadeval.images.disturbing import Disturbance
from roadeval.results.schema import DAMAGED, SCORED, TABLES, TAG, TYPES, UNSCORED
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.evaluation.score.scoreboard import Scoreboard
    from roadeval.results.facts import Facts

Row = tuple[Any, ...]
"""A row's cells in the order of its table's columns, without the key."""
LOST: Final = 3
"""Exit code of a replay that has lost a part of its log."""


class Key(NamedTuple):
    """The first two cells of every row."""

    drive: str
    camera: str

    def cells(self) -> str:
        """Return both as cells of CSV, each followed by a comma."""
        return "".join(f"{_cell(text)}," for text in self)


def doubt_rows(frame: Frame, doubts: Iterable[Doubt]) -> dict[str, list[Row]]:
    """Return the rows of ``unlabelled`` of a frame."""
    when = frame.number, frame.stamp_ns
    rows = [(*when, d.variant, d.stage, *(getattr(d, sign) for sign in SIGNS)) for d in doubts]
    return {"unlabelled": rows}


def condition_rows(result: FrameResult, values: Sequence[float]) -> dict[str, list[Row]]:
    """Return the row of ``conditions`` of an evaluated frame; no row for other frames."""
    when = result.frame.number, result.frame.stamp_ns
    return {"conditions": [(*when, *values)] if result.tallies else []}


def frame_rows(result: FrameResult) -> dict[str, list[Row]]:
    """Return the rows of an evaluated frame by table; no rows for other frames."""
    frame, tallies = result.frame, result.tallies
    number, finals = frame.number, {tally.variant: tally.stage for tally in tallies}
    when = number, frame.stamp_ns, frame.log_time_ns
    truth = result.truth_bits.checksum() if result.truth_bits else 0
    return {
        "frames": [(*when, mask.variant, mask.stage, *_numbers(mask), truth) for mask in tallies],
        "regions": [
            (number, mask.variant, mask.stage, region, *counts, counts.n)
            for mask in tallies
            for region, counts in mask.regions.items()
        ],
        "oracles": [
            (number, mask.variant, oracle, mask.stage, *_numbers(mask))
            for oracle, masks in result.oracles.items()
            for mask in masks
        ],
        "disturbances": [
            (number, disturbance.name, *disturbance, mask.variant, mask.stage, *_numbers(mask))
            for text, disturbed in result.disturbed.items()
            for disturbance in [Disturbance.parse(text)]
            for mask in disturbed.tallies
        ],
        "disagreements": [
            (number, one[0], other[0], *result.changes[*one, *other])
            for one, other in combinations(finals.items(), 2)
        ],
        "edges": [
            (
                *(number, variant, finals[variant], measure, f"{at}m" if at else "ahead"),
                *(round(end, 3) for end in ends),
            )
            for variant, metres in result.metres.items()
            for (measure, at), ends in zip(metres.measures, metres.ends[0].tolist(), strict=True)
        ],
    }


def _numbers(tally: Tally) -> Row:
    return *tally.counts, tally.counts.n, *tally.rates.values()


def sum_rows(
    board: Scoreboard, windows: pd.DataFrame, classes: Sequence[TruthClass] = ()
) -> dict[str, list[Row]]:
    """Return the rows of tables of sums over the drive; ``classes`` are the classes of its truth.

    Levels of probabilities that do not occur are left out, and cells of heat maps that are labelled
    and have no error. If any cell is labelled, the last cell has a row, because it tells the map's
    size.
    """
    heat, probabilities = list[Row](), list[Row]()
    for variant, heat_map in board.heat.items():
        side, sums = heat_map.cells()
        has_row = (sums[0] == 0) | sums[1:].any(axis=0)
        has_row[-1, -1] = True
        tops, lefts = (has_row & sums[0].any()).nonzero()
        cells = (tops * side, lefts * side, np.full_like(tops, side), *sums[:, tops, lefts])
        heat += [(variant, *cell) for cell in np.column_stack(cells).tolist()]
    for name, counts in board.curves.counts.items():
        other, road = at_levels(counts)
        levels = (other + road).nonzero()[0]
        columns = np.column_stack((levels, road[levels], other[levels]))
        probabilities += [(*name, *row) for row in columns.tolist()]
    parts = board.parts(classes)
    is_region = parts["region"].str.match(OF_REGIONS)
    parts = parts[~is_region.astype(bool) & (parts["variant"] != BASELINE)]
    return {
        "windows": [*windows.drop(columns=KEY).itertuples(index=False, name=None)],
        "changes": [(*step, *change) for step, change in board.changes.items()],
        "heat": heat,
        "probabilities": probabilities,
        "classes": [*board.classes.rows(classes)],
        "parts": [*parts.sort_values("frame", kind="stable").itertuples(index=False, name=None)],
        "metres": [tuple(row.values()) for row in board.metres()],
    }


def csv_lines(key: Key, rows: Mapping[str, Iterable[Row]]) -> dict[str, str]:
    """Return the lines of CSV of the tables that have rows."""
    start = key.cells()
    texts = {
        name: "".join(f"{start}{','.join(map(_cell, row))}\n" for row in table_rows)
        for name, table_rows in rows.items()
    }
    return {name: text for name, text in texts.items() if text}


def _cell(value: str | int | float) -> str:
    """Return a text, or the shortest decimal that reads back as the same number."""
    if isinstance(value, str):
        text = visible(value)
        escaped = text.replace('"', '""')
        return f'"{escaped}"' if "," in text or '"' in text else text
    return "" if isinstance(value, float) and math.isnan(value) else str(value)


def drive_row(facts: Facts, name: str, source: str) -> dict[str, Any]:
    """Return the row of ``drives`` of a drive that was replayed, under a name, from a source."""
    status = (DAMAGED if facts.losses else SCORED) if facts.totals else UNSCORED
    of_drive = ("start_ns", "end_ns", "rate_hz", "width", "height")
    account = ("in_log", "read", "decoded", "labelled", "trained_on", "evaluated")
    return {
        "name": name,
        "source": source,
        "status": status,
        "exit_code": LOST if facts.losses else 0,
        "reason": None if facts.totals else next(iter(facts.warnings), None),
        "log_digest": facts.log_digest,
        **{column: getattr(facts.drive, column) for column in of_drive},
        **{column: getattr(facts.frames, column) for column in account},
        "losses": "\n".join(facts.losses) or None,
        "warnings": "\n".join(facts.warnings) or None,
        "misfits": "\n".join(facts.misfits) or None,
        "verdict": facts.verdict,
    }


def table_of_scores(
    frames: pd.DataFrame, regions: pd.DataFrame, beyond: Sequence[Mapping[str, Any]]
) -> pd.DataFrame:
    """Return the table ``scores`` of any number of drives: each mask on all pixels, and by region.

    ``frames`` and ``regions`` are the tables of these names; ``beyond`` are further columns of
    final masks, as of `beyond_masks`. A region counts on the frames that label any of it.
    """
    import pandas as pd

    by = [*KEY, *MASK]
    masks = totals(frames, by).assign(truth=group_rows(frames, by)["truth"].sum()).reset_index()
    masks = masks.assign(region=ALL, final=is_final)
    parts = totals(regions[regions["N"] > 0], [*by, "region"]).reset_index()
    parts = parts.merge(masks[[*by, "final"]], on=by).assign(truth=0)
    if beyond:
        further = pd.DataFrame([*beyond]).assign(final=True)
        masks = masks.merge(further, on=[*KEY, "variant", "final"], how="left")
    rows = concatenate([masks, parts])
    order = group_rows(rows, by).ngroup().to_numpy()
    return rows.iloc[np.argsort(order, kind="stable")].reindex(columns=TABLES["scores"].names)


def beyond_masks(facts: Facts, key: Key) -> list[dict[str, Any]]:
    """Return the numbers of each final mask of a drive beyond its counts, for `table_of_scores`."""
    names = ("boundary_F", "boundary_IoU", "flicker", "truth_flicker")
    rows = []
    for variant, mask in facts.beyond.items():
        edges = {name.lower(): mask.get(name) for name in names}
        episodes = mask.get("episodes", {})
        lasting = {"episodes": episodes.get("episodes"), "episode_seconds": episodes.get("seconds")}
        rows.append({**key._asdict(), "variant": variant, **edges, **lasting})
    return rows


def effect_rows(facts: Facts, key: Key) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``effects``: each variant minus ``unfiltered``, and minus ``blind``."""
    for effect in facts.effects:
        mask = {"base": effect.base, "variant": effect.variant, "stage": effect.stage}
        for metric, change in effect.rates.items():
            frames = {"frames": change.units, "effective_frames": change.effective}
            numbers = {**vars(change), **frames}
            yield {**key._asdict(), **mask, "final": effect.final, "metric": metric, **numbers}


def table_of(
    name: str, rows: Iterable[Mapping[str, Any]], tags: Iterable[str] = ()
) -> pd.DataFrame:
    """Return a table of drives from its rows, with its columns and types; None means unknown."""
    import pandas as pd

    types = {c.name: TYPES[c.kind].replace("int", "Int") for c in TABLES[name].columns}
    types |= {f"{TAG}{tag}": "str" for tag in tags}
    table = pd.DataFrame([*rows], columns=[*types])
    return table.astype(types).where(table.notna())  # pandas 2 makes None the word "None"


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as dictionaries; unknown values are None."""
    plain = table.astype(object)
    return plain.where(table.notna(), None).to_dict("records")  # type: ignore[return-value]
