"""Labels that look wrong: areas where the truth contradicts predictions that are right elsewhere.

Methods and the labels of the frames before and after, moved with the picture, predict each label.
The rarer a prediction is wrong there on other frames, near frames above all, the more it counts: an
error that a method always makes is not a sign against a label.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, ROAD
from roadeval.data.arrays import Flags, Image, Plane, Values
from roadeval.evaluation.tables import spread

if TYPE_CHECKING:
    import pandas as pd

BLOCK: Final = 400
"""Number of successive labels that are examined together, which bounds the memory."""
_WIDEST: Final = 320
"""Greatest width of examined images in pixels; larger ones are reduced."""
_CELL: Final = 8
"""Pixels of a side of the squares in which the errors of a prediction are counted."""
_NEAR: Final = 5
"""Number of labels before and after one that count as near."""
_LEAST: Final = 0.02
"""Least share of errors that is assumed for a prediction."""
_STILL: Final = 12
"""Greatest mean difference in grey levels up to which a place looks the same in two images."""
_AGAINST: Final = 1.0
"""Log odds above which a pixel's label looks wrong."""
_SMALL: Final = 0.0015
"""Greatest size of a speck or a hole, as a share of the image."""
_SPECKS: Final = 4
"""Weight of specks and holes: they are rare in masks and scenes, so few pixels say much."""
_REACH: Final = 12
"""Greatest move that explains a label, in pixels."""
_UNKNOWN: Final = 255
"""The code of pixels without a prediction."""
_FLOOR: Final = 0.0025
"""Score per pixel below which labels are not told apart."""
_CLEAR: Final = 4
"""Multiple of the usual score of a drive from which a label is clearly wrong."""
_MUCH: Final = 10
"""The same multiple if only methods contradict the label: they may be wrong themselves."""


class LabelFlaw(StrEnum):
    """Why a label looks wrong."""

    ANOTHER_FRAME = "another_frame"
    MIRRORED = "mirrored"
    MOVED = "moved"
    SPECKS = "specks"
    JUMP = "jump"
    METHODS = "methods"


class Suspect(NamedTuple):
    """A label that looks wrong: a row of the table of suspects."""

    frame: int
    stamp_ns: int
    reason: str
    """A `LabelFlaw`."""
    detail: str
    """The other frame's number, the move in pixels, or what the area should be; else empty."""
    top: int
    left: int
    bottom: int
    right: int
    """The area in pixels; the last two are the first row and column behind it."""
    pixels: int
    """Pixels that look wrong."""
    score: float
    """Summed log odds against the label, per pixel of the image."""


@dataclass(frozen=True, eq=False)
class LabelledView:
    """A labelled frame at the size in which it is examined: ``(H, W)`` each, 0 to 255."""

    frame: int
    stamp_ns: int
    grey: Plane
    road: Plane
    ignored: Plane
    masks: Mapping[str, Plane]
    """The final masks of methods by their names, 0 to 254."""
    times: int
    """Number of columns, and of rows, that are averaged into one."""

    @classmethod
    def of(
        cls, frame: int, stamp_ns: int, image: Image, truth: Plane, masks: Mapping[str, Plane]
    ) -> LabelledView:
        """Reduce an ``(H, W, 3)`` image, its truth and the masks of methods, 1 for road."""
        import cv2

        times = -(-image.shape[1] // _WIDEST)
        size = max(image.shape[1] // times, 1), max(image.shape[0] // times, 1)

        def reduce(plane: Any) -> Plane:
            return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.uint8)

        grey = reduce(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        road, ignored = (reduce((truth == code) * np.uint8(255)) for code in (ROAD, IGNORE))
        sure = np.uint8(_UNKNOWN - 1)
        small = {name: reduce((mask == ROAD) * sure) for name, mask in masks.items()}
        return cls(frame, stamp_ns, grey, road, ignored, small, times)


def find_suspects(views: Sequence[LabelledView]) -> pd.DataFrame:
    """Return a row, a `Suspect`, for each label that looks wrong, in the order of the views.

    The views are successive labelled frames of one size; more of them tell more.
    """
    import pandas as pd

    names = dict.fromkeys(name for view in views for name in view.masks)
    against = np.zeros((len(views), *views[0].road.shape), np.float32)
    for name in names:
        against += _odds_against(views, [view.masks.get(name) for view in views])
    before = _odds_against(views, [None, *map(_carry_label, views, views[1:])])
    after = _odds_against(views, [*map(_carry_label, views[1:], views), None])
    against += before
    against += after
    jumps = (before > _AGAINST) & (after > _AGAINST)
    roads = np.array([view.road > 127 for view in views])
    places = zip(range(len(views)), against, jumps, strict=True)
    suspects = (_find_suspect(views, roads, *place) for place in places)
    return pd.DataFrame([*filter(None, suspects)], columns=[*Suspect._fields])


def rank_suspects(suspects: pd.DataFrame, labels: int, count: int) -> pd.DataFrame:
    """Return at most ``count`` suspects, the worst first and one for each scene.

    ``labels`` is the number of all examined labels. The column ``clear`` tells whether a label is
    clearly wrong, not only worth a look.
    """
    scores = np.zeros(max(labels, 1))
    scores[: len(suspects)] = suspects["score"]
    usual = _FLOOR + float(np.median(scores))
    least = np.where(suspects["reason"] == LabelFlaw.METHODS, _MUCH, _CLEAR)
    suspects = suspects.assign(clear=suspects["score"] > least * usual)
    suspects = suspects[suspects["score"] > usual]
    ranked = np.lexsort((-suspects["score"], ~suspects["clear"]))
    places = spread(suspects["stamp_ns"].to_numpy(np.int64), ranked, count)
    return suspects.iloc[places].reset_index(drop=True)


def _carry_label(near: LabelledView, view: LabelledView) -> Plane | None:
    """Return the label of a frame, ``(H, W)``, moved with the picture to another frame.

    Pixels where the moved picture differs are `_UNKNOWN`; None if the picture is narrow.
    """
    import cv2

    if min(view.grey.shape) < 32:  # 8x8 pixels are compared, at a quarter of the size
        return None
    dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = dense.calc(view.grey, near.grey, np.zeros((*view.grey.shape, 2), np.float32))
    height, width = view.grey.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    x, y = x + flow[..., 0], y + flow[..., 1]
    grey, road, ignored = (
        cv2.remap(plane, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for plane in (near.grey, near.road, near.ignored)
    )
    unlike = cv2.blur(cv2.absdiff(grey, view.grey).astype(np.float32), (9, 9)) >= _STILL
    outside = (x < -1) | (x > width) | (y < -1) | (y > height)
    carried = np.minimum(road, _UNKNOWN - 1)
    carried[unlike | outside | (ignored > 0)] = _UNKNOWN
    return np.asarray(carried, np.uint8)


def _odds_against(
    views: Sequence[LabelledView], predictions: Sequence[Plane | None]
) -> npt.NDArray[np.float32]:
    """Return the log odds, ``(n, H, W)``, against labels from one prediction of each label."""
    import cv2
    from scipy.ndimage import convolve1d

    height, width = views[0].road.shape
    cells = max(width // _CELL, 1), max(height // _CELL, 1)
    odds = np.zeros((len(views), height, width), np.float32)
    is_known = np.zeros(odds.shape, np.bool_)
    sums = np.zeros((2, len(views), cells[1], cells[0]))
    for place, (view, prediction) in enumerate(zip(views, predictions, strict=True)):
        if prediction is not None:
            is_known[place] = (view.ignored == 0) & (prediction != _UNKNOWN)
            odds[place] = cv2.absdiff(prediction, view.road) / np.float32(255) * is_known[place]
            for part, plane in zip(sums, (odds[place], np.float32(is_known[place])), strict=True):
                part[place] = cv2.blur(
                    cv2.resize(plane, cells, interpolation=cv2.INTER_AREA), (3, 3)
                )
    # The prior is half a frame of errors in one frame.
    total = sums.sum(axis=1, keepdims=True)
    near = convolve1d(sums, np.ones(2 * _NEAR + 1), axis=1, mode="constant")
    errors, near_errors = ((part[0] + 0.5) / (part[1] + 1) for part in (total - sums, near - sums))
    share = np.clip(np.maximum(errors, near_errors) + _LEAST, _LEAST, 0.5)
    weights = np.log((1 - share) / share).astype(np.float32)
    for place, weight in enumerate(weights):
        large = cv2.resize(weight, (width, height), interpolation=cv2.INTER_LINEAR)
        odds[place] = large * (2 * odds[place] - 1) * is_known[place]
    return odds


def _find_suspect(
    views: Sequence[LabelledView], roads: Flags, place: int, against: Values, jump: Flags
) -> Suspect | None:
    """Return the area of a label that looks most wrong, and why; None if no pixel does."""
    import cv2

    view, road, wrong = views[place], roads[place], (against > _AGAINST).astype(np.uint8)
    small = np.zeros(road.shape, np.bool_)
    for side in (road, ~road):
        _, parts, stats, _ = cv2.connectedComponentsWithStats(side.astype(np.uint8), connectivity=4)
        small |= (stats[:, cv2.CC_STAT_AREA] < _SMALL * road.size)[parts]
    count, areas, stats, _ = cv2.connectedComponentsWithStats(wrong, connectivity=4)
    sizes = stats[:, cv2.CC_STAT_AREA]
    is_speck = np.bincount(areas.ravel(), small.ravel(), count) > 0.5 * sizes
    core = cv2.morphologyEx(wrong, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    counted = np.where(core | is_speck[areas], np.maximum(against - _AGAINST, 0), 0)
    scores = np.bincount(areas.ravel(), counted.ravel(), count) * np.where(is_speck, _SPECKS, 1)
    scores[sizes < 4] = 0
    if not scores.any():
        return None
    reason, detail = _explain(views, roads, place, wrong > 0)
    area = scores[areas] > 0
    if reason is None and scores[is_speck].sum() > 0.5 * scores.sum():
        reason, area = LabelFlaw.SPECKS, area & is_speck[areas]
    elif reason is None:
        area = areas == scores.argmax()
        reason = LabelFlaw.JUMP if jump[area].mean() > 0.5 else LabelFlaw.METHODS
        detail = "no road" if road[area].mean() > 0.5 else "road"
    left, top, width, height = np.multiply(cv2.boundingRect(np.uint8(area)), view.times).tolist()
    box, pixels = (top, left, top + height, left + width), int(area.sum()) * view.times**2
    score = float(scores.sum()) / road.size
    return Suspect(view.frame, view.stamp_ns, reason, detail, *box, pixels, score)


def _explain(
    views: Sequence[LabelledView], roads: Flags, place: int, wrong: Flags
) -> tuple[LabelFlaw | None, str]:
    """Return the one mistake that explains a label, and the other frame's number or the move."""
    import cv2

    view, road = views[place], roads[place]
    expected, before = road ^ wrong, float(wrong.mean())
    if before < _SMALL or min(road.shape) <= 2 * _REACH:
        return None, ""
    unlike = (roads[:, ::2, ::2] ^ road[::2, ::2]).mean(axis=(1, 2))
    unlike[place] = 1
    # A label like those beside it fits the drive: where the road changes little, many are alike.
    beside = unlike[max(place - 1, 0) : place + 2]
    if unlike.min() < 0.1 * before and beside.min() > 0.5 * before:
        return LabelFlaw.ANOTHER_FRAME, str(views[unlike.argmin()].frame)
    seen = view.ignored == 0
    if ((road[:, ::-1] ^ expected) & seen).mean() < 0.5 * before:
        return LabelFlaw.MIRRORED, ""
    inner = expected[_REACH:-_REACH, _REACH:-_REACH].astype(np.float32)
    misfits = cv2.matchTemplate(road.astype(np.float32), inner, cv2.TM_SQDIFF)
    down, right = (int(at) - _REACH for at in np.unravel_index(misfits.argmin(), misfits.shape))
    if max(abs(down), abs(right)) > 1 and misfits.min() < 0.5 * misfits[_REACH, _REACH]:
        return LabelFlaw.MOVED, f"{right * view.times},{down * view.times}"
    return None, ""
