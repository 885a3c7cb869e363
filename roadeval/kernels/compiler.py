"""How a loop is compiled: once on a machine, for the arrays that its annotations name.

The code is kept in Numba's cache, and loaded from there by later runs. Because the types are
stated, no call compiles a loop anew for another kind of array: such a call is a `TypeError`. Arrays
are C-contiguous, and may be read-only.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any, Final, TypeVar

from numba import njit, types

F = TypeVar("F", bound=Callable[..., Any])


def _array(dtype: Any, dimensions: int) -> Any:
    return types.Array(dtype, dimensions, "C", readonly=True)


TYPES: Final = {
    "Image": _array(types.uint8, 3),
    "Plane": _array(types.uint8, 2),
    "Planes": types.UniTuple(_array(types.uint8, 2), 3),
    "CodeTable": _array(types.uint8, 2),
    "Labels": _array(types.int32, 2),
    "Runs": _array(types.int32, 2),
    "Bits": _array(types.uint64, 2),
    "Words": _array(types.uint64, 1),
    "Reach": _array(types.int64, 1),
    "Vector": _array(types.float64, 1),
    "Matrix": _array(types.float64, 2),
    "int": types.int64,
    "float": types.float64,
    "bool": types.boolean,
}
"""The compiler's types by the names in annotations, see `roadeval.data.arrays`."""


def compiled(function: F) -> F:
    """Return a function as a kernel: compiled at its first call, or before by `compile_ahead`."""
    made: F = njit(cache=True, nogil=True)(function)
    return made


def compile_ahead(kernel: Any) -> None:
    """Compile a kernel for the types of its annotations, or load it from the cache."""
    parameters = signature(kernel.py_func).parameters.values()
    kernel.compile(tuple(TYPES[each.annotation] for each in parameters))
    kernel.disable_compile()


def part(function: F) -> F:
    """Compile a function as a part of each kernel that calls it."""
    made: F = njit(nogil=True)(function)
    return made


def inlined(function: F) -> F:
    """Insert a function's code wherever a kernel calls it: a call would cost more than its work."""
    made: F = njit(nogil=True, inline="always")(function)
    return made
