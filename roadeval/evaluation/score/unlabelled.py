"""Frames without truth: which to look at, and how much masks differ. No sign is an error rate.

On CamVid, without its truth, the 20 frames with the highest entropy included 9 and 6 of the ten
worst; chance finds 2.2. Read as an error rate, entropy gives 1.2 % for masks that are 3.2 % wrong.
"""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import CODES, Doubt, FrameResult, Packed, Probability, VariantResult, ones
from roadeval.data.arrays import Floats, Sums, Values
from roadeval.data.result import as_tree
from roadeval.evaluation.stats.sampling import draw_order
from roadeval.evaluation.tables import spread

if TYPE_CHECKING:
    import pandas as pd

SIGNS: Final[Mapping[str, str]] = {
    "entropy": "how unsure road is, mean over every 16th pixel, from 0 to 1 bit",
    "disagreement": "share of pixels on which another variant differs, mean over the others",
    "flicker": "share of pixels that change from the frame before",
}
"""Signs of doubt with their meanings; a variant's frames are ranked by the first that it has."""
_STEP: Final = 4
"""Step in rows and columns between pixels; frames rank as with all pixels (r > 0.998)."""


@cache
def _entropies() -> Values:
    """Return ``-p log2 p - (1-p) log2 (1-p)`` of each code of a probability, ``(65536,)``."""
    p = np.linspace(0, 1, CODES)[1:-1]
    inner = -p * np.log2(p) - (1 - p) * np.log2(1 - p)
    return np.pad(inner, 1).astype(np.float32)


def entropy(probability: Probability) -> float:
    """Return the mean entropy of ``(H, W)`` uint16 codes of a probability, from 0 to 1 bit.

    The mean is over every 16th pixel: one in `_STEP` rows and columns.
    """
    return float(_entropies()[probability[::_STEP, ::_STEP]].mean())


def doubts_of(variants: Sequence[VariantResult]) -> tuple[Doubt, ...]:
    """Return each variant's doubt on a frame, without its flicker."""
    finals = {variant.variant: list(variant.masks())[-1] for variant in variants}
    differ: defaultdict[str, dict[str, float]] = defaultdict(dict)
    for one, other in combinations(finals, 2):
        differ[one][other] = differ[other][one] = _share(finals[one][1], finals[other][1])
    doubts = []
    for name, stages in ((variant.variant, variant.stages) for variant in variants):
        codes = [s.output.probability for s in stages if s.output.probability is not None]
        unsure = entropy(codes[-1]) if codes else math.nan
        doubts.append(Doubt(name, finals[name][0], unsure, differ[name]))
    return tuple(doubts)


def _share(one: Packed, other: Packed) -> float:
    """Return the share of pixels on which two masks differ; NaN if their sizes differ."""
    height, width = one.shape
    return ones(one.bits ^ other.bits) / (height * width) if one.shape == other.shape else math.nan


class Unlabelled:
    """Collects the doubts on a drive's frames, and adds their flicker.

    Frames are ranked by the doubts in the mask of ``focus``.
    """

    def __init__(self, focus: str) -> None:
        self.focus: Final = focus
        self._stages: dict[str, str] = {}
        self._stamps, self._signs = array("q"), array("d")
        """Number and stamp, and the values of `SIGNS`, of each frame of the focus."""
        self._differ = defaultdict[tuple[str, str], list[float]](lambda: [0.0, 0])
        self._before: Mapping[str, Packed] = {}

    def add(self, result: FrameResult) -> tuple[Doubt, ...]:
        """Add a frame, in the drive's order; return its doubts with their flicker."""
        before, variants = self._before, result.variants if result.doubts else ()
        self._before = now = {v.variant: mask for v in variants for _, mask in v.masks()}
        doubts = []
        for without_flicker in result.doubts:
            name = without_flicker.variant
            changed = _share(now[name], before[name]) if name in before else math.nan
            doubt = replace(without_flicker, flicker=changed)
            doubts.append(doubt)
            self._stages[name] = doubt.stage
            if name == self.focus:
                self._stamps.extend((result.frame.number, result.frame.stamp_ns))
                self._signs.extend(getattr(doubt, sign) for sign in SIGNS)
            for other, share in doubt.differs.items():
                pair = self._differ[name, other]
                pair[0] += share
                pair[1] += 1
        return tuple(doubts)

    def interrupt(self) -> None:
        """Note that the next frame does not follow the one before."""
        self._before = {}

    def rows(self) -> pd.DataFrame:
        """Return the rows of ``unlabelled.csv`` of the focus, without the key."""
        import pandas as pd

        when = np.array(self._stamps, np.int64).reshape(-1, 2)
        table = pd.DataFrame(when, columns=["frame", "stamp_ns"])
        table["variant"], table["stage"] = self.focus, self._stages.get(self.focus, "")
        table[[*SIGNS]] = np.array(self._signs).reshape(-1, len(SIGNS))
        return table

    def differing(self) -> dict[str, dict[str, float]]:
        """Return the mean share of pixels on which two variants differ, by pair of variants."""
        pairs = [pair for pair in combinations(self._stages, 2) if pair in self._differ]
        return as_tree((pair, self._differ[pair][0] / self._differ[pair][1]) for pair in pairs)


def sign_of(rows: pd.DataFrame) -> str | None:
    """Return the sign, of `SIGNS`, by which a variant's rows are ranked; None if there is none."""
    return next((sign for sign in SIGNS if rows[sign].notna().any()), None)


def choose_frames(
    stamps: Sums,
    scores: Floats,
    count: int,
    seed: int,
    *,
    drawn: int = 0,
    taken: Sequence[int] = (),
) -> tuple[Sums, Sums]:
    """Choose frames to label: half of them at random, half by rank.

    The random frames are the next ones in `draw_order`; a frame that is ``taken``, because it was
    chosen by rank before, needs no new label. The ranked frames have the highest scores and are no
    neighbours of other chosen ones, if there are enough.

    Parameters
    ----------
    stamps, scores
        ``(n,)`` of all frames: stamps in nanoseconds, and degrees of doubt, NaN if unknown.
    drawn, taken
        Number of frames that were drawn before, and the places of all frames that have a label.

    Returns
    -------
    tuple
        The places of the random frames, and of the ranked frames.
    """
    scored = np.flatnonzero(np.isfinite(scores))
    half = -(-count // 2) if len(scored) else count
    random = draw_order(len(stamps), seed)[drawn : drawn + half]
    without = [*{*taken, *random.tolist()}]
    missing = max(count - len({*random.tolist()} - {*taken}), 0)
    ranked = scored[np.argsort(-scores[scored], kind="stable")]
    ranked = ranked[~np.isin(ranked, without)]
    return random, spread(stamps, ranked, missing, stamps[without].tolist())
