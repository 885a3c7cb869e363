"""The paper's figures: what is drawn, and which files appear."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from pypdf import PdfReader

from roadeval.report.blocks import Document, Figure, ImageFile, ImageGrid
from roadeval.report.figures import figures, write_figures
from roadeval.report.images import ExampleFrame
from tests.evaluation.making import rows_of
from tests.report.making import NO_WINDOWS

LONG = "trained_on_every_drive_of_the_summer_and_adapted_to_this_one_and_much_more_of_the_kind"
BY_DEFAULT = ("filtered", "unfiltered", "blind")
FILES = {
    f"{stem}.{kind}"
    for stem in ("fig2_masks", "fig3a_error_rate", "fig3b_fp_fn_rate")
    for kind in ("png", "pdf")
}


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


def made(table: pd.DataFrame) -> tuple[Document, Document]:
    """Figures 3a and 3b."""
    (_, error_rate), (_, fp_fn_rate) = figures("drive", rows_of(table), [])
    return error_rate, fp_fn_rate


def charts(figure: Document) -> Figure:
    (found,) = (block for block in figure.blocks if isinstance(block, Figure))
    return found


def masks_of(examples: Sequence[ExampleFrame]) -> tuple[str, ImageGrid]:
    """The note and the pictures of figure 2."""
    ((_, figure),) = figures("drive", NO_WINDOWS, examples)
    _, note, grid = figure.blocks
    return note.text, grid


def pixels(image: ImageFile) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(image.content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_figure_3a_shows_err_of_every_final_mask_in_percent() -> None:
    table = a_table(4)
    (chart,) = charts(made(table)[0]).charts
    for series, variant in zip(chart.series, BY_DEFAULT, strict=True):
        own = table[(table["variant"] == variant) & (table["stage"] == "post")]
        assert series.name.startswith(f"{variant}: ")
        assert series.y == pytest.approx(100 * own["ERR"].to_numpy())


def test_figure_3b_shows_fpr_and_fnr_apart() -> None:
    fpr, fnr = charts(made(a_table(4))[1]).charts
    assert (fpr.title[:3], fnr.title[:3]) == ("FPR", "FNR")
    assert fnr.series[0].y == pytest.approx([4 * each for each in fpr.series[0].y])


def test_a_short_last_row_is_named() -> None:
    _, note, _ = made(a_table(3, last=1))[0].blocks
    assert note.text == (
        "Final mask (post); each point is the mean of 10 frames, the last of 1; lower is better"
    )
    _, note, _ = made(a_table(3))[0].blocks
    assert "the last" not in note.text


def test_figure_2_has_a_row_a_frame_and_a_column_a_mask() -> None:
    _, grid = masks_of([an_example(7), an_example(33)])
    columns = ["filtered", "unfiltered", "truth"]
    assert [title for title, _ in grid.pictures] == ["frame 7", *columns, "frame 33", *columns]
    assert grid.columns == 4


def test_figure_2_without_truth_has_no_column_for_it() -> None:
    _, grid = masks_of([an_example(truth=False)])
    assert [title for title, _ in grid.pictures] == ["frame 7", "filtered", "unfiltered"]


def test_masks_are_tinted_and_edged_and_leave_the_rest_as_it_is() -> None:
    _, grid = masks_of([an_example()])
    picture = pixels(grid.pictures[1][1]).astype(int)
    for place, expected in (((3, 3), 90), ((12, 20), 255), ((19, 20), (50, 121, 101))):
        assert np.abs(picture[place] - expected).max() < 30, "but for the loss of a JPEG"


def test_ignored_pixels_are_grey_and_named() -> None:
    example = an_example()
    assert example.truth is not None
    truth = example.truth.copy()
    truth[:8] = 255
    note, grid = masks_of([ExampleFrame(1, example.image, truth, example.masks)])
    assert np.abs(pixels(grid.pictures[3][1])[2, 2].astype(int) - 120).max() < 6
    assert "grey: ignored" in note
    assert "grey" not in masks_of([example])[0]


def test_a_frame_without_a_mask_is_faded_in_its_column() -> None:
    image, mask = np.full((4, 6, 3), 105, np.uint8), np.ones((4, 6), np.uint8)
    given = ({"unfiltered": mask}, {"unfiltered": mask, "net": mask})
    note, grid = masks_of([ExampleFrame(n, image, mask, own) for n, own in enumerate(given)])
    title, picture = grid.pictures[2]
    assert title == "net: no mask"
    assert pixels(picture).min() > 220
    assert "faded: there is no mask" in note


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> list[list[Path]]:
    """The files of one drive, written twice."""
    folders = [tmp_path_factory.mktemp("figures") / "new" for _ in range(2)]
    return [
        write_figures(folder, "drive", rows_of(a_table(3)), [an_example()]) for folder in folders
    ]


def test_all_files_appear_and_no_other(twice: list[list[Path]]) -> None:
    assert {path.name for path in twice[0]} == FILES
    assert {path.name for path in twice[0][0].parent.iterdir()} == FILES


def test_equal_results_give_equal_files(twice: list[list[Path]]) -> None:
    for one, other in zip(*twice, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_pdfs_embed_their_fonts_and_have_no_date(twice: list[list[Path]]) -> None:
    for path in twice[0]:
        if path.suffix == ".pdf":
            content = path.read_bytes()
            assert b"/FontFile" in content
            assert b"CreationDate" not in content


def test_a_png_is_opaque_and_1600_pixels_across(twice: list[list[Path]]) -> None:
    for path in twice[0]:
        if path.suffix == ".png":
            image = Image.open(path)
            assert image.width == 1600
            assert image.mode == "RGB" or image.getextrema()[3] == (255, 255)


def test_long_names_stay_within_the_page(tmp_path: Path) -> None:
    table = rows_of(a_table(5, ("filtered", "unfiltered", LONG, "b", "c", "d")))
    write_figures(tmp_path, "道路 Straße", table, [])
    for path in tmp_path.glob("*.pdf"):
        (page,) = PdfReader(path).pages
        assert LONG in page.extract_text()
        ends: list[float] = []
        page.extract_text(visitor_text=lambda _t, cm, tm, *_, e=ends: e.append(cm[4] + tm[4]))
        assert max(ends) < page.mediabox.width


def test_without_rates_only_masks_are_drawn(tmp_path: Path) -> None:
    write_figures(tmp_path, "drive", NO_WINDOWS, [an_example(truth=False)])
    assert {path.name for path in tmp_path.iterdir()} == {"fig2_masks.png", "fig2_masks.pdf"}
