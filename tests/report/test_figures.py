"""The paper's figures: what is drawn, how it can be told apart, and which files appear."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from pypdf import PdfReader

from roadeval.report.blocks import Figure, ImageGrid, Report
from roadeval.report.drawing import MARKED, place_chart
from roadeval.report.figures import CROWDED, error_rate, fp_fn_rate, road_masks, write_figures
from roadeval.report.images import ExampleFrame
from roadeval.report.pdf.typeset import typeset
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


def words(figure: Report) -> str:
    return PdfReader(BytesIO(typeset(figure))).pages[0].extract_text()


def pictures(figure: Report) -> list[list[np.ndarray]]:
    """The images of figure 2, row by row."""
    (grid,) = figure.blocks
    assert isinstance(grid, ImageGrid)
    files = [np.asarray(Image.open(BytesIO(image.content))) for _, image in grid.pictures]
    return [files[at : at + grid.columns] for at in range(0, len(files), grid.columns)]


def test_a_rate_that_is_undefined_everywhere_says_so() -> None:
    table = a_table(3).assign(FNR=np.nan)
    assert words(fp_fn_rate("drive", table)).count("undefined on every frame") == 1


def test_variants_are_named_by_what_they_do() -> None:
    names = words(error_rate("drive", a_table(3, ["filtered", "blind", "n" * 100])))
    assert "filtered: with the shadow filter" in names
    assert "blind: never looks at the image" in names
    assert "n" * 100 not in names.replace("\n", "")


def test_a_long_drive_is_drawn_as_means_of_rows_with_some_marks() -> None:
    table = a_table(3600)
    figure = error_rate("drive", table)
    (block,) = figure.blocks
    assert isinstance(block, Figure)
    (chart,) = block.charts
    line = chart.series[0]
    assert len(line.y) == CROWDED
    marks = place_chart(chart).shapes[0].marks
    assert MARKED / 2 < len(marks) <= MARKED
    first = 100 * table.query("variant == 'filtered' and stage == 'post'")["ERR"].to_numpy()[:24]
    assert line.y[0] == pytest.approx(first.mean())
    assert "the mean of 24 rows of 10 frames" in figure.subtitle


def test_a_frame_without_a_mask_is_faded_in_its_column() -> None:
    image, mask = np.full((4, 6, 3), 105, np.uint8), np.ones((4, 6), np.uint8)
    masks = ({"unfiltered": mask}, {"unfiltered": mask, "net": mask})
    examples = [ExampleFrame(n, image, mask, by_variant) for n, by_variant in enumerate(masks)]
    figure = road_masks("drive", examples)
    assert [len(row) for row in pictures(figure)] == [4, 4]
    assert set(pictures(figure)[0][2].ravel().tolist()) == {225}
    assert "faded: there is no mask" in figure.subtitle


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
    assert road_masks("drive", [small]) == road_masks("drive", [large])


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> list[list[Path]]:
    """The files of one drive, written twice."""
    folders = [tmp_path_factory.mktemp("figures") / "new" for _ in range(2)]
    return [write_figures(folder, "drive", a_table(3), [an_example()]) for folder in folders]


def test_equal_results_give_equal_files(twice: list[list[Path]]) -> None:
    for one, other in zip(*twice, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_picture_is_opaque_and_wide_enough_for_print(twice: list[list[Path]]) -> None:
    figure = Image.open(next(p for p in twice[0] if p.name == "fig3a_error_rate.png"))
    assert figure.width > 1600
    assert figure.mode == "RGB" or figure.getextrema()[3] == (255, 255), "nothing shines through"


def test_a_pdf_holds_each_picture_once_and_as_jpeg(twice: list[list[Path]]) -> None:
    content = next(p for p in twice[0] if p.name == "fig2_masks.pdf").read_bytes()
    assert content.count(b"/DCTDecode") == len({"the camera", "the mask, thrice"})
    assert len(PdfReader(BytesIO(content)).pages) == 1


def test_without_rates_only_masks_are_drawn(tmp_path: Path) -> None:
    write_figures(tmp_path, "drive", read_table("windows", ""), [an_example(truth=False)])
    assert {path.name for path in tmp_path.iterdir()} == {"fig2_masks.png", "fig2_masks.pdf"}
