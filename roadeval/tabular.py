"""The tables read back, from a results folder and from a recording alike."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import NAMES

if TYPE_CHECKING:
    import pandas as pd

RATES: Final = ("ACC", "ERR", "TPR", "FNR", "TNR", "FPR")
"""Columns that hold fractions, each also as ``pooled_...``; all but these and names are counts."""


def read_table(source: Path | str, columns: Sequence[str]) -> pd.DataFrame:
    """Read a table bit by bit; an undefined rate is NaN.

    Parameters
    ----------
    source
        A CSV file, or its text with the header line. Without any text there are no rows.
    columns
        The columns of a table without rows.

    Returns
    -------
    DataFrame
        Names are text, whatever they look like; rates are float64, all else int64.
    """
    import pyarrow as pa
    from pyarrow import csv

    schema = pa.schema([(column, _kind(column)) for column in columns])
    if not source:
        table = schema.empty_table()
    else:
        file = BytesIO(source.encode()) if isinstance(source, str) else source
        table = csv.read_csv(file, convert_options=csv.ConvertOptions(column_types=schema))
    frame: pd.DataFrame = table.to_pandas()
    return frame


def _kind(column: str) -> Any:
    """Give a column's type in Arrow."""
    import pyarrow as pa

    if column in NAMES:
        return pa.string()
    return pa.float64() if column.removeprefix("pooled_") in RATES else pa.int64()
