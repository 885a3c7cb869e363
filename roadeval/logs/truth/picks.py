"""Frames that were picked to be labelled, why, and with what probability: ``pick.json``."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from roadeval.data import ROAD, Truth
from roadeval.logs.errors import LogError
from roadeval.logs.files import first_names
from roadeval.logs.truth.named_labels import NamedLabels
from roadeval.runtime.documents import read_bounded, read_json

PICK: Final = "pick.json"
IMAGES: Final = "images"
PROPOSALS: Final = "proposals"
LABELS: Final = "labels"
"""The file and the folders in a folder of picked frames."""
FORMAT: Final = {"name": "roadeval-pick", "version": 1}


class Why(StrEnum):
    """Why a frame was picked."""

    RANDOM = "random"
    """A frame drawn at random; such frames estimate the error rate of the drive."""
    RANKED = "ranked"
    """A frame among the most doubtful; such frames are for inspection and training."""


@dataclass(frozen=True)
class Picked:
    """A picked frame."""

    frame: int
    stamp_ns: int
    why: Why
    probability: float | None
    """Probability of being drawn; None for a ranked frame."""
    score: float | None
    proposal: str
    """Digest of the proposed mask, see `digest_of`."""
    wave: int = 1
    """The number of the command that picked it, from 1."""


@dataclass(frozen=True)
class Picks:
    """All picked frames of a camera's drive, and the frames from which they were picked."""

    drive: str
    camera: str
    log: str | None
    """The log's digest, if it is known."""
    method: Mapping[str, Any]
    """The ``variant`` that made the masks, its ``ranked_by`` score, the run's ``identity``."""
    seed: int
    drawn: int
    """Frames that were drawn by chance so far, in `roadeval.evaluation.stats.draw_order`."""
    frames: list[int]
    stamps: list[int]
    scores: list[float | None]
    """Every frame that could be picked: its number, its stamp and its degree of doubt."""
    picked: list[Picked]
    format: dict[str, Any] = field(default_factory=lambda: dict(FORMAT))

    def text(self) -> str:
        """Return the document."""
        return json.dumps(asdict(self), indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Picks | None:
        """Read the picks of a folder; None if it has none. A `LogError` if they are damaged."""
        path = folder / PICK
        if not path.is_file():
            return None
        try:
            picks = TypeAdapter(cls).validate_python(read_json(read_bounded(path)))
        except (OSError, ValueError) as error:
            reason, remedy = str(error).partition("\n")[0], "pick into a new folder"
            raise LogError(f"damaged ({reason})", where=path, remedy=remedy) from error
        if contradiction := picks._contradiction():
            problem = f"not as roadeval pick writes it ({contradiction})"
            remedy = "take the file as it was written, or pick into a new folder"
            raise LogError(problem, where=path, remedy=remedy)
        return picks

    @classmethod
    def of_labels(cls, labels: Path) -> Picks | None:
        """Read the picks of the folder with these labels; None if there are none."""
        folders = [labels, *labels.resolve().parents[:2]]
        return next((picks for folder in folders if (picks := cls.read(folder))), None)

    def _contradiction(self) -> str:
        """Return how the numbers contradict each other; empty if they do not."""
        random = sum(frame.why is Why.RANDOM for frame in self.picked)
        frame_of = dict(zip(self.stamps, self.frames, strict=False))
        sizes = {len(self.frames), len(self.stamps), len(self.scores), len(frame_of)}
        if self.format != FORMAT or len(sizes) > 1 or not self.frames:
            return "its lists of frames, stamps and scores do not fit together"
        if len(self.by_stamp) < len(self.picked):
            return "a frame is picked twice"
        if any(frame_of.get(frame.stamp_ns) != frame.frame for frame in self.picked):
            return "a picked frame is not in the list of all"
        if random != self.drawn:
            return f"{random} frames are random, but {self.drawn} were drawn"
        return ""

    # Stamps are compared as floats, because programs that rewrite JSON round them to floats.

    @cached_property
    def places(self) -> dict[float, int]:
        """The positions of all frames that could be picked, by their stamps."""
        return {float(stamp): place for place, stamp in enumerate(self.stamps)}

    @cached_property
    def by_stamp(self) -> dict[float, Picked]:
        """The picked frames by their stamps."""
        return {float(frame.stamp_ns): frame for frame in self.picked}

    def is_picked(self, stamp_ns: int, why: Why) -> bool:
        """Return whether a frame was picked for a reason."""
        picked = self.by_stamp.get(float(stamp_ns))
        return picked is not None and picked.why is why

    def every_score(self) -> npt.NDArray[np.float64]:
        """Return the degree of doubt of each frame, ``(n,)``; NaN if it is unknown."""
        return np.array(self.scores, np.float64)

    def check(self, labels: NamedLabels) -> None:
        """Raise a `LogError` if labels have numbers of frames that were not picked."""
        picked = {frame.frame for frame in self.picked}
        keys = labels.log_times.tolist()
        others = [labels.labels[at].path for at, key in enumerate(keys) if key not in picked]
        if labels.by == "number" and others:
            raise LogError(
                f"{len(others)} of {len(keys)} labels have numbers of frames that were not "
                f"picked ({first_names(others)})",
                where=labels.name,
                remedy=f"give them the names of their images in {IMAGES}",
            )

    def is_proposal(self, stamp_ns: int, truth: Truth) -> bool:
        """Return whether a label is the unchanged proposal, which nobody has corrected."""
        picked = self.by_stamp.get(float(stamp_ns))
        return picked is not None and picked.proposal == digest_of(truth == ROAD)


def digest_of(road: npt.NDArray[np.bool_]) -> str:
    """Return the BLAKE2b of an ``(H, W)`` mask, 8 bytes in hexadecimal."""
    packed = np.packbits(road).tobytes()
    return hashlib.blake2b(packed, digest_size=8).hexdigest()
