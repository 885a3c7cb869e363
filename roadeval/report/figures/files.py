"""The paper's figures as files: PNG to look at, PDF to print. No screen is needed.

Equal results give equal files, byte for byte.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.errors import RoadevalError
from roadeval.report.figures.masks import Example, road_masks
from roadeval.report.figures.rates import error_rate, fp_fn_rate
from roadeval.report.figures.style import RC
from roadeval.runtime import files

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["Example", "FiguresError", "write_figures"]

_SAVING: Final[dict[str, dict[str, Any]]] = {
    # This packs twice as fast as Pillow's own choice, into files 4 % larger.
    "png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 4}},
    "pdf": {"metadata": {"CreationDate": None, "Producer": None, "Creator": "roadeval"}},
}
_DPI: Final = 200


class FiguresError(RoadevalError):
    """The figures cannot be written."""


def write_figures(
    folder: Path, drive: str, windows: pd.DataFrame, examples: Sequence[Example]
) -> list[Path]:
    """Write ``fig2_masks``, ``fig3a_error_rate`` and ``fig3b_fp_fn_rate`` as PNG and PDF.

    A figure that would be empty is not written, and one of that name from an earlier run is
    removed: rates need a row of ``windows``, masks an example.

    Parameters
    ----------
    folder
        Made if it does not exist.
    drive
        Stands in the titles.
    windows
        As ``windows.csv``, any number of variants.
    examples
        Frames for figure 2.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    FiguresError
        If the folder cannot be written to.
    """
    drawings: dict[str, Callable[[], Figure] | None] = {
        "fig2_masks": (lambda: road_masks(drive, examples)) if examples else None,
        "fig3a_error_rate": (lambda: error_rate(drive, windows)) if len(windows) else None,
        "fig3b_fp_fn_rate": (lambda: fp_fn_rate(drive, windows)) if len(windows) else None,
    }
    try:
        return [path for name, draw in drawings.items() for path in _write(folder / name, draw)]
    except OSError as error:
        raise FiguresError(
            f"{error.filename or folder}: cannot write figures ({error.strerror}); "
            "choose another folder with --reports"
        ) from error


def _write(stem: Path, draw: Callable[[], Figure] | None) -> list[Path]:
    """Draw a figure and write it in both formats; without a drawing, remove what is there."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    paths = [stem.with_suffix(f".{kind}") for kind in _SAVING]
    if draw is None:
        for path in paths:
            path.unlink(missing_ok=True)
        return []
    with mpl.rc_context(RC):  # type: ignore[arg-type]
        figure = draw()
        FigureCanvasAgg(figure)
        for path, (kind, saving) in zip(paths, _SAVING.items(), strict=True):
            drawn = BytesIO()
            figure.savefig(drawn, format=kind, dpi=_DPI, **saving)
            files.put(path, drawn.getvalue())
    return paths
