"""A drive's masks, frame by frame, from its fleet's table of frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data.counts import OUTCOMES
from roadeval.evaluation.drives_comparison_result import Mask, MaskFrames
from roadeval.results.fleet.record import frames_path
from roadeval.results.fleet.tables import read_frames
from roadeval.results.tables import AGAIN, ResultsError

_COLUMNS: Final = ["stamp_ns", "variant", "stage", *OUTCOMES]


def read_masks(folder: Path, drive: str) -> dict[Mask, MaskFrames]:
    """Read the counts of a drive's masks, in the order of its frames.

    Raises
    ------
    ResultsError
        If they are not there, or damaged.
    """
    try:
        table = read_frames(folder, drive, _COLUMNS)
    except FileNotFoundError:
        raise ResultsError(f"{frames_path(folder, drive)}: is not there; {AGAIN}") from None
    counts = np.stack([table[name].to_numpy() for name in OUTCOMES], axis=1)
    stamps = table["stamp_ns"].to_numpy()
    codes, masks = _codes(table)
    return {
        mask: MaskFrames(stamps[own], counts[own])
        for code, mask in enumerate(masks)
        for own in [np.flatnonzero(codes == code)]
        if len(own)
    }


def _codes(table: Any) -> tuple[Any, list[Mask]]:
    """Return the number of each row's mask, and the masks in the order in which they come."""
    variants, stages = (
        table[name].combine_chunks().dictionary_encode() for name in ("variant", "stage")
    )
    width = len(stages.dictionary)
    codes = variants.indices.to_numpy().astype(np.int64) * width + stages.indices.to_numpy()
    names = [(v, s) for v in variants.dictionary.to_pylist() for s in stages.dictionary.to_pylist()]
    return codes, names
