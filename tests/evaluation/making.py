"""Small frames, masks and results to score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import signal

from roadeval.data import (
    Counts,
    Frame,
    Mask,
    Output,
    Rows,
    StageResult,
    Tally,
    Truth,
    VariantResult,
)
from roadeval.data.arrays import Bits
from roadeval.data.packed import Packed
from roadeval.evaluation import metrics


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


def a_tally(tp: int, tn: int, fp: int, fn: int, variant: str = "filtered") -> Tally:
    """A tally of the final mask with these counts."""
    counts = Counts(tp, tn, fp, fn)
    return Tally(variant, "post", counts, {}, metrics.of(counts))


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
                    }
                )
    return pd.DataFrame(rows)


def rows_of(table: pd.DataFrame) -> Rows:
    """The rows of a table as `roadeval.results.tables.read_rows` gives them."""
    texts = {"variant", "stage", "region"}
    return Rows({n: np.array(table[n].tolist(), str if n in texts else None) for n in table})


def autoregression(rng: np.random.Generator, frames: int, rho: float) -> npt.NDArray[np.float64]:
    """A drive of differences with mean 0, variance 1 and lag-1 correlation ``rho``."""
    noise = rng.standard_normal(frames + 500)
    series: npt.NDArray[np.float64] = signal.lfilter([1], [1, -rho], noise)[500:]
    return series * np.sqrt(1 - rho**2)
