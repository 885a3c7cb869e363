"""Small frames, masks and results to score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import signal

from roadeval.data import (
    OUTCOMES,
    Counts,
    Frame,
    Mask,
    Output,
    Packed,
    Rows,
    StageResult,
    Truth,
    VariantResult,
)
from roadeval.data.arrays import Bits
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison import Change, ComparedResult, Comparison, Part, Side
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference


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


def a_table(errors: Mapping[tuple[str, str], Sequence[int]], hertz: float = 10) -> pd.DataFrame:
    """A ``frames.csv`` by variant and stage: how many of a frame's 100 pixels are wrong.

    Half the pixels are road; all errors are false positives.
    """
    rows = []
    for number in range(max(map(len, errors.values()))):
        for (variant, stage), wrong in errors.items():
            if number < len(wrong):
                counts = Counts(tp=50, tn=50 - wrong[number], fp=wrong[number])
                rows.append(
                    {
                        "frame": number,
                        "stamp_ns": round(number * 1e9 / hertz),
                        "log_time_ns": round(number * 1e9 / hertz),
                        "variant": variant,
                        "stage": stage,
                        "TP": counts.tp,
                        "TN": counts.tn,
                        "FP": counts.fp,
                        "FN": counts.fn,
                        "N": counts.n,
                        **metrics.of(counts),
                        "truth": 7,
                    }
                )
    return pd.DataFrame(rows)


def rows_of(table: pd.DataFrame) -> Rows:
    """The rows of a table as `roadeval.results.tables.read_rows` gives them."""
    texts = {"variant", "stage", "region", "from_variant", "to_variant"}
    return Rows({n: np.array(table[n].tolist(), str if n in texts else None) for n in table})


def autoregression(rng: np.random.Generator, frames: int, rho: float) -> npt.NDArray[np.float64]:
    """A drive of differences with mean 0, variance 1 and lag-1 correlation ``rho``."""
    noise = rng.standard_normal(frames + 500)
    series: npt.NDArray[np.float64] = signal.lfilter([1], [1, -rho], noise)[500:]
    return series * np.sqrt(1 - rho**2)


def compared_drive(
    tables: Mapping[str, Rows], drive: str = "street", digest: str | None = "d1", **more: Any
) -> Part:
    """A drive of a result that is compared, with some tables."""
    known = {**_NOTHING, **tables}
    scored = "frames" in tables and len(tables["frames"]) > 0
    return Part(drive, drive, digest, scored, more.pop("asked", {}), known.__getitem__, **more)


_NOTHING = {
    "scores": rows_of(
        pd.DataFrame(
            {name: [] for name in ("variant", "stage", "region", "frames", "ERR", *OUTCOMES)}
        )
    ),
    "regions": rows_of(pd.DataFrame({"variant": [], "stage": [], "region": [], "frame": []})),
    "disagreements": rows_of(
        pd.DataFrame(
            {
                name: []
                for name in ("from_variant", "to_variant", "frame", "repaired", "spoiled", "N")
            }
        )
    ),
}


def a_part(errors: Mapping[tuple[str, str], Sequence[int]], **more: Any) -> Part:
    """A drive whose frames have so many wrong pixels of 100 by variant and stage, at 10 Hz."""
    return compared_drive({"frames": rows_of(a_table(errors))}, **more)


def a_side(label: str, errors: Sequence[int], **more: Any) -> Side:
    """A result of one drive with a variant ``filtered``, which has so many wrong pixels of 100."""
    return Side(label, [a_part({("filtered", "post"): errors}, **more)])


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
) -> Change:
    """A mask whose every rate was 10 % and changed so much."""
    rates = ("ERR", "FPR", "FNR", "IoU")
    base, new = (dict.fromkeys(rates, rate) for rate in (0.1, 0.1 + difference.mean))
    differences = dict.fromkeys(rates[:3], difference)
    return Change(result, variant, stage, final, drives, 12, base, new, differences)


def a_comparison(*changes: Change, **more: Any) -> Comparison:
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
