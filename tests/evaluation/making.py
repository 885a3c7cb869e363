"""Small frames, masks and results to score."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import signal

from roadeval.data import (
    OUTCOMES,
    Frame,
    Mask,
    Output,
    Packed,
    StageResult,
    Truth,
    VariantResult,
)
from roadeval.data.arrays import Bits
from roadeval.evaluation.comparison.compare import ComparedResult, Comparison, MaskChange
from roadeval.evaluation.comparison.pairing import ComparedDrive, Side
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.tables import concatenate, rates_of
from roadeval.results.schema import TABLES
from roadeval.results.tables import read_table


def pixels(*rows: str) -> npt.NDArray[np.uint8]:
    """Read an image from text: ``#`` is 1, ``.`` is 0, ``?`` is ignored."""
    values = {"#": 1, ".": 0, "?": 255}
    return np.array([[values[char] for char in row] for row in rows], np.uint8)


def unpacked(bits: Bits, width: int) -> npt.NDArray[np.uint8]:
    """Give the mask of ``width`` pixels a row that bits stand for."""
    return np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little", count=width)


def a_frame(truth: Truth | None, number: int = 0, shadow: Truth | None = None) -> Frame:
    """A black frame with the given truth, at 10 Hz."""
    shape = (2, 2) if truth is None else truth.shape
    image = np.zeros((*shape, 3), np.uint8)
    return Frame(number, 10**8 * number, 10**8 * number + 7, image, b"", None, truth, shadow)


def a_variant(
    name: str, masks: Mapping[str, Mask], regions: Mapping[str, Mask] | None = None
) -> VariantResult:
    """A variant with a mask a stage; its first stage found the regions."""
    found = {region: Packed.of(mask) for region, mask in (regions or {}).items()}
    stages = [
        StageResult(stage, Output(mask=Packed.of(mask), regions={} if place else found), 0.002)
        for place, (stage, mask) in enumerate(masks.items())
    ]
    return VariantResult(name, tuple(stages))


CAMERA = "/camera/image"
Wrong = Mapping[tuple[str, str], Sequence[int]]
"""By variant and stage: how many of a frame's 100 pixels are wrong, frame by frame."""


def table_of(name: str, rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The rows of a drive's table, typed as they are read: names are categoricals."""
    if not rows:
        return read_table(name, "")
    table = pd.DataFrame([{"drive": "street", "camera": CAMERA, **row} for row in rows])
    words = (c.name for c in TABLES[name].columns if c.is_word)
    for word in (word for word in words if word in table):
        table[word] = pd.Categorical(table[word], [*dict.fromkeys(table[word])])
    return table


def a_table(errors: Wrong, hertz: float = 10, **key: Any) -> pd.DataFrame:
    """The rows of ``frames``. Half the pixels are road; all errors are false positives."""
    counts = [
        (number, variant, stage, 50, 50 - wrong[number], wrong[number], 0, 100)
        for number in range(max(map(len, errors.values())))
        for (variant, stage), wrong in errors.items()
        if number < len(wrong)
    ]
    names = ("frame", "variant", "stage", *OUTCOMES, "N")
    rows = [{**dict(zip(names, row, strict=True)), **key} for row in counts]
    table = table_of("frames", rows)
    stamps = (table["frame"] * 1e9 / hertz).round().astype(np.int64)
    table = table.assign(stamp_ns=stamps, log_time_ns=stamps, truth=7)
    return table.join(rates_of(table, METRICS)) if rows else table


def autoregression(rng: np.random.Generator, frames: int, rho: float) -> npt.NDArray[np.float64]:
    """A drive of differences with mean 0, variance 1 and lag-1 correlation ``rho``."""
    noise = rng.standard_normal(frames + 500)
    series: npt.NDArray[np.float64] = signal.lfilter([1], [1, -rho], noise)[500:]
    return series * np.sqrt(1 - rho**2)


Drive = tuple[ComparedDrive, Mapping[str, pd.DataFrame]]


def a_drive(errors: Wrong, drive: str = "street", digest: str | None = "d1", **more: Any) -> Drive:
    """A drive of a result that is compared, with ``tables`` beside ``frames``."""
    key = {"drive": drive, "camera": more.pop("camera", CAMERA)}
    tables = {"frames": a_table(errors, **key), **more.pop("tables", {})}
    about = {"name": drive, "settings": {}, "frames": tables["frames"]["frame"].nunique()}
    return ComparedDrive(**key, digest=digest, **about | more), tables


def a_result(label: str, *drives: Drive) -> Side:
    """A result of some drives."""

    def table(name: str, keys: Collection[tuple[str, str]]) -> pd.DataFrame:
        parts = (own[name] for about, own in drives if about.key in keys and name in own)
        return concatenate([*parts, table_of(name, [])])

    return Side(label, [about for about, _ in drives], table)


def a_side(label: str, errors: Sequence[int], **more: Any) -> Side:
    """A result of one drive with a variant ``filtered``, which has so many wrong pixels of 100."""
    return a_result(label, a_drive({("filtered", "post"): errors}, **more))


def altered(side: Side, **columns: Callable[[pd.Series[Any]], Any]) -> Side:
    """The result with columns of its frames replaced by what these functions make of them."""

    def table(name: str, keys: Collection[tuple[str, str]]) -> pd.DataFrame:
        rows = side.tables(name, keys)
        if name != "frames":
            return rows
        return rows.assign(**{column: make(rows[column]) for column, make in columns.items()})

    return replace(side, tables=table)


def a_difference(
    mean: float, low: float | None = None, high: float | None = None, p: float = 0.001, **known: Any
) -> Difference:
    """A difference over 12 frames, in percentage points; without ``low`` they are too few."""
    ends = [None if end is None else end / 100 for end in (low, high)]
    given = {"units": 0 if np.isnan(mean) else 12, "needed": 20 if low is None else None}
    chance = None if low is None else p
    return Difference(mean / 100, *ends, chance, 0.95, "frames", **given | known)


def a_change(
    difference: Difference,
    variant: str = "filtered",
    result: str = "new",
    *,
    stage: str = "post",
    final: bool = True,
    drives: int = 1,
) -> MaskChange:
    """A mask whose every rate was 10 % and changed so much."""
    rates = ("ERR", "FPR", "FNR", "IoU")
    base, new = (dict.fromkeys(rates, rate) for rate in (0.1, 0.1 + difference.mean))
    differences = dict.fromkeys(rates[:3], difference)
    return MaskChange(result, variant, stage, final, drives, 12, base, new, differences)


def a_comparison(*changes: MaskChange, **more: Any) -> Comparison:
    """A comparison with these changes, of one drive."""
    labels = ["base", *dict.fromkeys(change.result for change in changes)]
    parts = ("drives", "regions", "moved", "disagreements", "warnings")
    known: dict[str, Any] = {
        "results": tuple(ComparedResult(label, 1, 1, "street", "d", 12, None) for label in labels),
        "changes": changes,
        "levels": changes,
        "changed_settings": {},
        **dict.fromkeys(parts, ()),
        "settings": EvaluationSettings(),
    }
    return Comparison(**known | more)
