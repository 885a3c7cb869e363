"""The viewer's component columns for numbers and texts: one row a value."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from roadeval.recording.layout import COUNTS


def scalars(values: list[float]) -> Any:
    """Return columns of one number a row."""
    return rr.Scalars.columns(scalars=values)


def counts(values: list[tuple[int, ...]]) -> Any:
    """Return columns of the numbers of `layout.COUNTS` a row."""
    flat = np.array(values, np.float64).ravel()
    return rr.Scalars.columns(scalars=flat).partition([len(COUNTS)] * len(values))


def states(values: list[str]) -> Any:
    """Return columns that begin a state a row, or end one with an empty text."""
    return rr.StateChange.columns(state=values)


def texts(values: list[str]) -> Any:
    """Return columns of one document a row."""
    return rr.TextDocument.columns(text=values)


def notes(values: list[tuple[str, str]]) -> Any:
    """Return columns of one sentence and its level a row."""
    sentences, levels = zip(*values, strict=True)
    return rr.TextLog.columns(text=list(sentences), level=list(levels))
