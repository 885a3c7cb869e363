"""The tables read back, from a results folder and from a recording alike."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import NAMES
from roadeval.errors import RoadevalError

if TYPE_CHECKING:
    import pandas as pd

RATES: Final = ("ACC", "ERR", "TPR", "FNR", "TNR", "FPR")
"""Columns that hold fractions, each also as ``pooled_...``; all but these and names are counts."""


class TableError(RoadevalError):
    """A table that is damaged."""


def read_table(source: Path | str, columns: Sequence[str]) -> pd.DataFrame:
    """Read a table bit by bit; an undefined rate is NaN.

    Parameters
    ----------
    source
        A CSV file, or its text with the header line. Without any text there are no rows.
    columns
        The columns that must be there; their names settle their types, rows or none.

    Returns
    -------
    DataFrame
        Names are text, whatever they look like; rates are float64, all else int64.

    Raises
    ------
    TableError
        If the table is empty, cut off, lacks a column or holds a value of another type.
    """
    import pyarrow as pa
    from pyarrow import csv

    schema = pa.schema([(column, _kind(column)) for column in columns])
    if not source:
        table = schema.empty_table()
    else:
        text = source.encode() if isinstance(source, str) else source.read_bytes()
        options = csv.ConvertOptions(column_types=schema)
        try:
            table = csv.read_csv(BytesIO(text), convert_options=options)
        except pa.ArrowInvalid as error:
            raise _damaged(source, str(error).partition("\n")[0]) from error
        if not text.endswith(b"\n"):
            raise _damaged(source, "its last line is cut off")
        if missing := set(columns) - set(table.column_names):
            raise _damaged(source, f"no column {', '.join(sorted(missing))}")
    frame: pd.DataFrame = table.to_pandas()
    return frame


def _damaged(source: Path | str, why: str) -> TableError:
    where = source if isinstance(source, Path) else "a table of the recording"
    return TableError(f"{where}: damaged ({why}); make the results anew with roadeval replay")


def _kind(column: str) -> Any:
    """Give a column's type in Arrow."""
    import pyarrow as pa

    if column in NAMES:
        return pa.string()
    return pa.float64() if column.removeprefix("pooled_") in RATES else pa.int64()
