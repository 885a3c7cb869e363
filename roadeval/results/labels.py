"""Labels that look wrong, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from roadeval.data.words import counted, first_of, percent
from roadeval.evaluation.score.label_errors import LabelFlaw

if TYPE_CHECKING:
    import pandas as pd

_REASONS: Final[Mapping[str, str]] = {
    LabelFlaw.ANOTHER_FRAME: "it is the label of frame {}",
    LabelFlaw.MIRRORED: "left and right are exchanged",
    LabelFlaw.MOVED: "it lies {} of its place",
    LabelFlaw.SPECKS: "specks or holes that nothing else has",
    LabelFlaw.JUMP: "the labels before and after say {} in the same place",
    LabelFlaw.METHODS: "methods that are right at this place in other frames see {}",
}


def describe_suspect(suspect: Mapping[str, Any]) -> str:
    """Return why a label looks wrong, by a row of the suspects.

    >>> describe_suspect({"reason": "moved", "detail": "12,-4"})
    'it lies 12 px right and 4 px above of its place'
    """
    detail = str(suspect["detail"])
    if suspect["reason"] == LabelFlaw.MOVED:
        ways = zip(map(int, detail.split(",")), ("right left", "below above"), strict=True)
        detail = " and ".join(f"{abs(by)} px {words.split()[by < 0]}" for by, words in ways if by)
    return _REASONS[suspect["reason"]].format(detail)


def describe_suspects(suspects: pd.DataFrame) -> str:
    """Return a sentence on the frames with clearly wrong labels, from the ranked suspects."""
    frames = sorted(suspects[suspects["clear"]]["frame"].tolist())
    if len(frames) < 2:
        is_wrong = f"The label of frame {frames[0]} looks wrong." if frames else ""
        return is_wrong or "No label is clearly wrong."
    named = first_of([*map(str, frames)], 10)
    return f"The labels of {len(frames)} frames look wrong: {named}."


def describe_annotator(name: str, share: float, frames: int) -> str:
    """Return the meaning of the share of pixels that two people label differently.

    >>> print(describe_annotator("b", 0.009, 20).partition(":")[0])
    b and the truth differ on 0.9 % of the pixels of 20 frames
    """
    return (
        f"{name} and the truth differ on {percent(share, 1)} % of the pixels of "
        f"{counted(frames, 'frame')}: differences of ERR below that mean nothing."
    )
