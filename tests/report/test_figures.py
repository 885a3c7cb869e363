"""The paper's figures: what is drawn, how it can be told apart, and which files appear."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image
from pypdf import PdfReader

from roadeval.report.figures import (
    CROWDED,
    DPI,
    ERROR_RATE,
    FP_FN_RATE,
    MARKED,
    RC,
    FigurePicture,
    as_svg,
    over_drive,
    road_masks,
    write_figures,
)
from roadeval.report.images import ExampleFrame
from roadeval.results.tables import read_table

BY_DEFAULT = ("filtered", "unfiltered", "blind")


def a_table(rows: int, variants: Sequence[str] = BY_DEFAULT, last: int = 10) -> pd.DataFrame:
    """A ``windows.csv`` of rates that differ by row, variant and stage."""
    lines = []
    for row in range(rows):
        frames = last if row == rows - 1 else 10
        for place, variant in enumerate(variants):
            for stage in ("post",) if variant == "blind" else ("svm", "post"):
                err = 0.05 + 0.02 * place + 0.01 * np.sin(row) + 0.2 * (stage == "svm")
                lines.append(
                    {
                        "window": row,
                        "first_frame": 10 * row,
                        "last_frame": 10 * row + frames - 1,
                        "frames": frames,
                        "variant": variant,
                        "stage": stage,
                        "ERR": err,
                        "FPR": err / 2,
                        "FNR": 2 * err,
                    }
                )
    return pd.DataFrame(lines)


def an_example(frame: int = 7, *, truth: bool = True) -> ExampleFrame:
    image = np.full((24, 40, 3), 90, np.uint8)
    mask = np.zeros((24, 40), np.uint8)
    mask[12:, 10:30] = 1
    return ExampleFrame(
        frame, image, mask if truth else None, {"filtered": mask, "unfiltered": mask}
    )


def draw(figure: Figure) -> Figure:
    FigureCanvasSVG(figure)
    as_svg(figure)
    return figure


@pytest.fixture(autouse=True)
def as_in_a_run():
    with rc_context(RC):
        yield


def texts(figure: Figure) -> str:
    legends = [legend for ax in figure.axes if (legend := ax.get_legend())]
    names = [name for legend in legends for name in legend.get_texts()]
    return " ".join(text.get_text() for text in (*figure.texts, *names))


def pictures(figure: Figure) -> list[list[np.ndarray]]:
    """The images of figure 2, row by row."""
    placed = [artist for artist in figure.artists if isinstance(artist, FigurePicture)]
    rows = groupby(placed, lambda picture: picture.box.y0)
    return [[np.asarray(picture.get_array()) for picture in row] for _, row in rows]


def test_a_rate_that_is_undefined_everywhere_says_so() -> None:
    table = a_table(3).assign(FNR=np.nan)
    fpr, fnr = draw(over_drive(FP_FN_RATE, "drive", table)).axes
    assert not fpr.texts
    assert fnr.texts[0].get_text() == "undefined on every frame"


def test_variants_are_named_by_what_they_do() -> None:
    names = texts(over_drive(ERROR_RATE, "drive", a_table(3, ["filtered", "blind", "n" * 100])))
    assert "filtered: with the shadow filter" in names
    assert "blind: never looks at the image" in names
    assert "n" * 81 not in names


def test_a_long_drive_is_drawn_as_means_of_rows_with_some_marks() -> None:
    table = a_table(3600)
    figure = over_drive(ERROR_RATE, "drive", table)
    *_, line = figure.axes[0].lines
    assert len(line.get_ydata()) == CROWDED
    assert CROWDED / line.get_markevery() == MARKED
    first = 100 * table.query("variant == 'filtered' and stage == 'post'")["ERR"].to_numpy()[:24]
    assert line.get_ydata()[0] == pytest.approx(first.mean())
    assert "the mean of 24 windows of 10 frames" in texts(figure)


def test_the_legend_reads_row_by_row_in_the_order_of_the_variants() -> None:
    figure = over_drive(ERROR_RATE, "", a_table(3, [*"abcd"]))
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    # Matplotlib fills three columns, one after the other, with two, one and one.
    assert names == ["a", "d", "b", "c"]


@pytest.mark.parametrize(("last", "said"), [(10, ""), (4, ", the last one of 4")])
def test_a_short_last_point_is_marked_and_said(last: int, said: str) -> None:
    figure = over_drive(FP_FN_RATE, "drive", a_table(3, last=last))
    assert f"is the mean of 10 frames{said};" in texts(figure)
    assert ("mean of 4 frames" in texts(figure)) == bool(said)
    spans = [[round(p.get_x(), 1), p.get_width()] for ax in figure.axes for p in ax.patches]
    assert spans == [[19.5, 4]] * len(figure.axes) * bool(said)


@pytest.mark.parametrize("name", [ERROR_RATE, FP_FN_RATE])
def test_a_figure_for_a_column_has_its_width_and_no_words_above(name: str) -> None:
    figure = over_drive(name, "", a_table(3, last=4), 3.35)
    assert figure.get_figwidth() == 3.35
    assert not figure.texts
    FigureCanvasAgg(figure).draw()
    box = figure.axes[0].get_legend().get_window_extent()
    assert box.x1 <= figure.bbox.x1
    assert box.y1 <= figure.bbox.y1


def test_a_vector_file_holds_its_text_as_text(tmp_path: Path) -> None:
    files = write_figures(tmp_path, "a drive", a_table(3), [], width=4, kinds=("pdf", "svg"))
    pdf, svg = (path for path in files if path.stem == "fig3a_error_rate")
    assert ">Error rate on a drive</text>" in svg.read_text()
    (page,) = PdfReader(pdf).pages
    assert "Error rate on a drive" in page.extract_text()
    fonts = page["/Resources"]["/Font"].values()
    assert {font.get_object()["/Subtype"] for font in fonts} == {"/Type0"}
    assert page.mediabox.width == pytest.approx(4 * 72, abs=0.1)


def test_a_frame_without_a_mask_is_faded_in_its_column() -> None:
    image, mask = np.full((4, 6, 3), 105, np.uint8), np.ones((4, 6), np.uint8)
    masks = ({"unfiltered": mask}, {"unfiltered": mask, "net": mask})
    examples = [ExampleFrame(n, image, mask, by_variant) for n, by_variant in enumerate(masks)]
    figure = road_masks("drive", examples)
    assert [len(row) for row in pictures(figure)] == [4, 4]
    assert set(pictures(figure)[0][2].ravel().tolist()) == {225}
    assert "faded: there is no mask" in texts(figure)


@pytest.mark.parametrize("width", [40, 1000])
def test_a_small_example_is_drawn_like_the_large_one(width: int) -> None:
    rng = np.random.default_rng(0)
    shape = 31, width
    image = rng.integers(0, 256, (*shape, 3), np.uint8)
    truth = rng.choice(np.array([0, 1, 255], np.uint8), shape)
    large = ExampleFrame(3, image, truth, {"net": rng.integers(0, 2, shape, np.uint8)})
    small = large.small()
    assert small.image.shape[1] <= 400
    assert small.truth is not None
    assert set(np.unique(small.truth)) == {0, 1, 255}
    figures = [road_masks("drive", [example]) for example in (small, large)]
    assert figures[0].get_figheight() == figures[1].get_figheight()
    for of_small, of_large in zip(*(pictures(figure)[0] for figure in figures), strict=True):
        np.testing.assert_array_equal(of_small, of_large)


def test_a_png_shows_what_matplotlib_would_save(tmp_path: Path) -> None:
    windows = a_table(3)
    write_figures(tmp_path, "drive", windows, [])
    typst = Image.open(tmp_path / "fig3a_error_rate.png")
    content = BytesIO()
    over_drive(ERROR_RATE, "drive", windows).savefig(content, format="png", dpi=DPI)
    matplotlib = Image.open(content)
    assert typst.size == matplotlib.size
    assert typst.mode == "RGB" or typst.getextrema()[3] == (255, 255), "nothing shines through"
    # The two draw the edges of letters differently; five pixels off gives 0.985 at most.
    grey = [np.asarray(image.convert("L"), float) for image in (typst, matplotlib)]
    blurred = [cv2.GaussianBlur(image, (0, 0), 8).ravel() for image in grey]
    assert np.corrcoef(*blurred)[0, 1] > 0.99


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> list[list[Path]]:
    """The files of one drive, written twice."""
    folders = [tmp_path_factory.mktemp("figures") / "new" for _ in range(2)]
    return [write_figures(folder, "drive", a_table(3), [an_example()]) for folder in folders]


def test_equal_results_give_equal_files(twice: list[list[Path]]) -> None:
    for one, other in zip(*twice, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_pdf_holds_each_picture_once_and_as_jpeg(twice: list[list[Path]]) -> None:
    content = next(p for p in twice[0] if p.name == "fig2_masks.pdf").read_bytes()
    assert content.count(b"/DCTDecode") == len({"the camera", "the mask, thrice"})
    assert len(PdfReader(BytesIO(content)).pages) == 1


def test_without_rates_only_masks_are_drawn(tmp_path: Path) -> None:
    write_figures(tmp_path, "drive", read_table("windows", ""), [an_example(truth=False)])
    assert {path.name for path in tmp_path.iterdir()} == {"fig2_masks.png", "fig2_masks.pdf"}
