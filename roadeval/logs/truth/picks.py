"""Frames that were picked to be labelled: which, why, and how probable each was; ``pick.json``."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter, ValidationError

from roadeval.data import ROAD, Truth
from roadeval.images import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import PROPOSED, Proposal
from roadeval.logs.truth.formats.coco import COCO
from roadeval.logs.truth.formats.cvat import CVAT
from roadeval.logs.truth.formats.labelme import LABELME
from roadeval.runtime.documents import read_bounded, read_json

PICK: Final = "pick.json"
IMAGES: Final = "images"
PROPOSALS: Final = "proposals"
LABELS: Final = "labels"
"""What the folder of picked frames holds: this file, and these folders."""
FORMAT: Final = {"name": "roadeval-pick", "version": 1}
WRITTEN: Final = {"coco": COCO, "labelme": LABELME, "cvat": CVAT}
"""Formats of annotation tools in which masks to correct are written."""


class Why(StrEnum):
    """Why a frame was picked."""

    RANDOM = "random"
    """Drawn by chance: the number for the whole drive comes from these."""
    RANKED = "ranked"
    """Most in doubt: to look at, and to learn from."""


@dataclass(frozen=True)
class Picked:
    """A picked frame."""

    frame: int
    stamp_ns: int
    why: Why
    probability: float | None
    """Of being among those that were drawn; None of a ranked one."""
    score: float | None
    proposal: str
    """Digest of the mask that was proposed, see `digest_of`."""
    wave: int = 1
    """By which command, from 1."""


@dataclass(frozen=True)
class Picks:
    """All picked frames of a camera's drive, and the frames from which they were picked."""

    drive: str
    camera: str
    log: str | None
    """The log's digest, if it is known."""
    method: Mapping[str, Any]
    """The ``variant`` that made the masks, the sign it is ``ranked_by``, the run's ``identity``."""
    seed: int
    drawn: int
    """Frames that were drawn by chance so far, in `roadeval.evaluation.stats.draw_order`."""
    frames: list[int]
    stamps: list[int]
    scores: list[float | None]
    """Every frame that could be picked: its number, its stamp and how much it was in doubt."""
    picked: list[Picked]
    format: dict[str, Any] = field(default_factory=lambda: dict(FORMAT))

    def text(self) -> str:
        """Return the document."""
        return json.dumps(asdict(self), indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Picks | None:
        """Read the picks of a folder; None where it holds none. A `LogError` if damaged."""
        path = folder / PICK
        if not path.is_file():
            return None
        try:
            found = TypeAdapter(cls).validate_python(read_json(read_bounded(path)))
        except (OSError, ValueError, ValidationError) as error:
            reason = str(error).partition("\n")[0]
            raise LogError(f"{path}: damaged ({reason}); pick into a new folder") from error
        sizes = {len(found.frames), len(found.stamps), len(found.scores)}
        if found.format != FORMAT or len(sizes) > 1 or len({*found.stamps}) < len(found.stamps):
            raise LogError(f"{path}: not as roadeval pick writes it; pick into a new folder")
        return found

    @cached_property
    def places(self) -> dict[int, int]:
        """The places of all frames that could be picked, by their stamps."""
        return {stamp: place for place, stamp in enumerate(self.stamps)}

    @cached_property
    def by_stamp(self) -> dict[int, Picked]:
        """The picked frames by their stamps."""
        return {each.stamp_ns: each for each in self.picked}

    def stamps_of(self, why: Why) -> frozenset[int]:
        """Return the stamps of the frames that were picked for a reason."""
        return frozenset(each.stamp_ns for each in self.picked if each.why is why)

    def every_score(self) -> npt.NDArray[np.float64]:
        """Return how much each frame was in doubt, ``(n,)``; NaN where that is not known."""
        return np.array([math.nan if each is None else each for each in self.scores])

    def is_proposal(self, stamp_ns: int, truth: Truth) -> bool:
        """Return whether a label is still as it was proposed, so that nobody has corrected it."""
        own = self.by_stamp.get(stamp_ns)
        return own is not None and own.proposal == digest_of(truth == ROAD)


def proposal_files(format_: str, proposals: Sequence[Proposal]) -> Mapping[str, bytes]:
    """Return the files of masks to correct, by their names, in one of the formats of `WRITTEN`."""
    write = WRITTEN[format_].write
    assert write is not None
    return write(proposals)


def as_read(format_: str, proposal: Proposal) -> npt.NDArray[np.bool_]:
    """Return the ``(H, W)`` mask as its file is read again: LabelMe's outlines are smoother."""
    if format_ != "labelme":
        return proposal.road
    (content,) = proposal_files(format_, [proposal]).values()
    (drawn,) = WRITTEN[format_].read(Path(proposal.image), json.loads(content), None)
    drawn = drawn.whole(None)
    values = {name: int(name == PROPOSED) for name in drawn.classes}
    return np.equal(drawn.pixels(values, Limits()), 1)


def digest_of(road: npt.NDArray[np.bool_]) -> str:
    """Return what tells an ``(H, W)`` mask from another, in hexadecimal."""
    packed = np.packbits(road).tobytes()
    return hashlib.blake2b(packed, digest_size=8).hexdigest()
