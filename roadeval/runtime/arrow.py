"""Arrow without pandas, which it looks for when it is first given numbers or lists."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Final

PANDAS: Final = "pandas"


class _NoPandas(MetaPathFinder):
    """Finds no pandas, and leaves all else to the finders after it."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        if fullname == PANDAS:
            raise ModuleNotFoundError(f"No module named {PANDAS!r}", name=PANDAS)
        return None


def leave_out_pandas() -> None:
    """Let Arrow not find pandas when it looks for it, so that it does not import it.

    That takes a fifth of a second or more, and 45 MB, and Arrow does it for every recording. It
    looks once; what needs pandas, as ``to_pandas``, imports it all the same. But arrays of pandas'
    own count as any sequence then, and its missing values as any object: call this only in a
    process that gives Arrow no objects of pandas'. Where pandas is imported already, it is found.
    """
    import numpy as np
    import pyarrow as pa

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array(np.zeros(1))  # looked for by Arrow's Python
        pa.scalar(0)  # and by its C++
    finally:
        sys.meta_path.remove(finder)
