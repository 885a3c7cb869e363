"""Checks of learnt parameters: finite numbers of known shapes, wherever they come from."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

GREATEST: Final = 1e15
"""No learnt number is larger, so that sums of products of two and a colour stay finite, in
float32 too."""


def check_arrays(
    parameters: Any, dtype: type[np.number[Any]], **shapes: tuple[int | str, ...]
) -> None:
    """Check what the functions of a stage assume about its parameters.

    A `ValueError` if a field has another shape or type, or holds a number that is not finite, or is
    beyond `GREATEST` in an array; a sentence that names the field.

    Parameters
    ----------
    parameters
        A dataclass.
    dtype
        The type of its arrays. Single numbers may be of any real type and any size.
    shapes
        The shape of each field. A letter stands for a length of one or more, the same wherever
        it occurs; ``()`` is a single number.
    """
    lengths: dict[int | str, int] = {}
    for name, shape in shapes.items():
        array = np.asarray(getattr(parameters, name))
        if not _matches(array.shape, shape, lengths):
            raise ValueError(f"{name} has the shape {_text(array.shape)} instead of {_text(shape)}")
        if array.dtype != dtype if shape else array.dtype.kind not in "iuf":
            raise ValueError(f"{name} is of type {array.dtype} instead of {np.dtype(dtype)}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds a number that is not finite")
        if shape:
            check_range(name, array, -GREATEST, GREATEST)


def check_range(name: str, values: npt.ArrayLike, least: float, greatest: float) -> None:
    """Raise a ValueError if a number lies outside a range, both ends included."""
    array = np.asarray(values, np.float64)  # no smaller type may have to hold the ends
    if not ((array >= least) & (array <= greatest)).all():
        raise ValueError(f"{name} holds a number outside {least:g} to {greatest:g}")


def check_covariance(name: str, matrix: npt.NDArray[np.float64], least: float) -> None:
    """Raise a ValueError if a matrix is not symmetric, or has an eigenvalue below ``least``."""
    if not np.allclose(matrix, matrix.T):
        raise ValueError(f"{name} is not symmetric, and so no covariance")
    if np.linalg.eigvalsh(matrix)[0] < least:
        raise ValueError(f"{name} has an eigenvalue below {least:g}, and so is no covariance")


def _matches(
    shape: tuple[int, ...], wanted: tuple[int | str, ...], lengths: dict[int | str, int]
) -> bool:
    """Compare shapes, and remember in ``lengths`` what each letter has come to stand for."""
    return len(shape) == len(wanted) and all(
        length > 0
        and length == (each if isinstance(each, int) else lengths.setdefault(each, length))
        for length, each in zip(shape, wanted, strict=True)
    )


def _text(shape: tuple[int | str, ...]) -> str:
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
