"""The parts of a drive's report: what each says where numbers lack or cannot be sure."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest

import roadeval.report
from roadeval import Result, write_report
from roadeval.data import ERRORS
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.stats.slices import FrameCondition, Slice
from roadeval.evaluation.tables import windows
from roadeval.report.blocks import (
    Cell,
    Command,
    Details,
    Figure,
    Heading,
    ImageGrid,
    KeepTogether,
    Table,
    Text,
    TwoColumns,
    plain,
)
from roadeval.report.captions import caption, captions
from roadeval.report.charts import standard as charts
from roadeval.report.document import document, page_document
from roadeval.report.findings import Findings, NotableFrame
from roadeval.report.images import LayerImage
from roadeval.report.sections import drive, drives
from roadeval.report.sections.drive import filter_effect, over_drive, regions, thresholds
from roadeval.report.sections.failures import when_it_fails
from roadeval.report.sections.frames import FrameBrowser, notable_frame, strip, worst_frames
from roadeval.report.sections.ground import UNSURE, distance_table
from roadeval.report.tables import differences_table, rates_table, stages_table
from roadeval.results.facts import Facts, FrameAccount, TrainingFacts
from roadeval.results.fleet import APART_NS, OF_A_DRIVE, FleetFolder
from roadeval.results.schema import FAILED, SCORED
from roadeval.results.tables import read_table
from tests.evaluation.making import a_table
from tests.report.making import (
    VARIANTS,
    a_difference,
    a_total,
    by_rate,
    column,
    opened,
    plain_rows,
    rates,
    some_findings,
    text,
    the,
)
from tests.results.fleet.making import fleet_of
from tests.results.making import facts_of


def texts(findings):
    return [block.text for block in filter_effect(findings) if isinstance(block, Text)]


def test_where_there_is_no_interval_the_reason_is_given():
    rates = by_rate(err=a_difference(-0.02))
    found = some_findings(effects=[Effect("unfiltered", "filtered", "post", True, rates)])
    assert any("No interval for ERR: 1,200 frames are too few" in text for text in texts(found))


# --- Over thresholds ------------------------------------------------------------------------------

QUOTED = {
    "frames": 8,
    "AP": 0.91,
    "MaxF": 0.93,
    "threshold": 0.4,
    "precision": 0.95,
    "recall": 0.96,
}
LEVELS = [("filtered", "post", 20, 2, 8), ("filtered", "post", 230, 4, 1)]

COLUMNS = ["variant", "stage", "level", "road", "other"]


def findings(**quoted):
    tables = {"probabilities": pd.DataFrame(LEVELS, columns=COLUMNS)}
    return some_findings(
        table=lambda name: tables.get(name, read_table(name, "")),
        curves={"filtered": {"post": QUOTED | quoted}},
    )


@pytest.mark.parametrize(
    ("stated", "wrong", "told"),
    [(0.02, 0.08, True), (0.02, 0.03, False), (0.002, 0.006, False), (0.1, 0.05, False)],
)
def test_a_variant_that_errs_twice_as_often_as_it_says_is_called_over_confident(
    stated, wrong, told
):
    own = {"ECE": 0.05, "confidence": 1 - stated, "right": 1 - wrong, "threshold": 0.00757}
    (table,) = (block for block in opened(thresholds(findings(**own))) if isinstance(block, Table))
    assert ("filtered is over-confident: by its probabilities" in table.caption) == told
    assert table.rows[0][4:6] == ["0.00757", "5.00"]


def test_the_curves_are_charts_with_the_masks_at_their_own_thresholds():
    (figure,) = (block for block in opened(thresholds(findings())) if isinstance(block, Figure))
    recall, reliable = figure.charts
    curve, mask, *_ = recall.series
    assert reliable.series[1].x == pytest.approx([100 * 20 / 255, 100 * 230 / 255])
    assert reliable.series[1].y == pytest.approx([100 * 2 / 10, 100 * 4 / 5])
    # Of 6 road and 9 other pixels, 4 and 1 are of the higher level.
    assert curve.x == pytest.approx([100 * 4 / 6, 100])
    assert curve.y == pytest.approx([80, 100 * 6 / 15])
    assert (mask.name, mask.x, mask.y) == (
        "filtered: the mask",
        [83.0],
        [pytest.approx(100 * 6 / 9)],
    )
    # Half of the room at least.
    assert (recall.x_range, recall.y_range) == ((50, 101), (50, 101))


# --- Regions --------------------------------------------------------------------------------------


def of_regions(*regions, variants=VARIANTS):
    """A table in which every number is another."""
    masks = pd.MultiIndex.from_product([regions, variants], names=["region", "variant"])
    places = np.arange(len(masks)) / 1000
    return pd.DataFrame(
        {"pixels": 0.1 + places, "ERR": 0.2 + places, "errors": 0.4 + places}, masks
    )


def test_the_trimap_is_a_curve_over_widths_and_has_a_hole_where_no_pixel_is_near():
    beyond = {name: {"trimap": {"1": [0, 0], "8": [3, 12]}} for name in VARIANTS[:2]}
    findings = some_findings(regions=of_regions("boundary", "interior"), beyond=beyond)
    (details,) = (block for block in regions(findings) if isinstance(block, Details))
    (chart,) = details.blocks[0].charts
    assert chart.names == ["1", "8"]
    assert [each.name for each in chart.series] == ["filtered", "unfiltered"]
    assert [*chart.series[0].points()] == [(1, 25)]


def a_frame(number, **changes):
    plain = {
        "rates": {"filtered": rates(0.4, 0.3, 0.2), "unfiltered": rates(0.5, 0.6, 0.7)},
        "notes": ["A note.", "Another."],
    }
    return NotableFrame(number, 12_345_000_000, "filtered", **plain | changes)


def shown(findings):
    return [block.blocks for block in worst_frames(findings) if isinstance(block, KeepTogether)]


def said(blocks):
    return [block.text for block in the(TwoColumns, blocks).left]


def test_where_the_recording_is_not_at_hand_no_command_opens_a_frame_and_that_is_told():
    (blocks,) = shown(some_findings(worst=[a_frame(7)], inspect=None))
    assert not [block for block in blocks if isinstance(block, Command)]
    assert caption("no command") in [block.text for block in blocks if isinstance(block, Text)]


def test_outcomes_are_at_most_520_pixels_across_and_layers_300():
    image, mask = np.zeros((4, 700, 3), np.uint8), np.zeros((4, 700), np.uint8)
    outcome, layer = (LayerImage(title, image, ERRORS, mask) for title in ("errors", "svm"))
    frame = NotableFrame(
        7, 0, "filtered", {"filtered": rates(0.4)}, images=[outcome], layers=[[layer]]
    )
    found = strip(frame, ["filtered"])
    assert [[across(each) for each in row] for row in found.rows] == [[520], [300]]


def across(picture):
    """Pixels across a picture's file."""
    content = np.frombuffer(picture.image.content, np.uint8)
    return cv2.imdecode(content, cv2.IMREAD_COLOR).shape[1]


def bold(table, title):
    return [cell.text for cell in column(table, title) if cell.bold]


ALONE = {"filtered": {"post": a_total(0.1)}}


def test_undefined_rates_are_never_the_best_and_told_and_how_often():
    findings = some_findings()
    findings.facts.totals["filtered"]["post"]["ERR"] = math.nan
    assert bold(rates_table(findings.facts), "ERR") == ["12.00"]
    undefined = {"FNR": 1200, "FPR": 3, "ERR": 0}
    totals = {"filtered": {"post": a_total(0.1) | {"undefined": undefined}}}
    assert list(drive.warnings(some_findings(totals=totals))) == [
        "filtered: means leave out the frames on which a rate is undefined "
        "(FNR on 1,200 and FPR on 3 of 1,200 frames)."
    ]


def test_a_drive_that_trained_itself_says_so():
    own = some_findings(totals=ALONE, training=TrainingFacts("truth"))
    assert [text.partition(" (")[0] for text in drive.warnings(own)] == [
        "Trained on frames of this drive"
    ]
    given = TrainingFacts("truth", model="city.model")
    assert not list(drive.warnings(some_findings(totals=ALONE, training=given)))


NAMES = ["filtered", "unfiltered"]


def row(variant: str, measure: str, where: str, value: float, sway: float) -> dict[str, Any]:
    own = {"variant": variant, "measure": measure, "where": where, "frames": 9, "missing": 1}
    return own | {"value": value, "p95": 0.5, "low": value - sway, "high": value + sway / 2}


def test_a_difference_that_a_wrong_camera_could_explain_is_marked():
    rows = [
        row("filtered", "ERR", "0-10m", 0.10, 0.02),
        row("filtered", "ERR", "from_above", 0.10, 0.02),
        row("unfiltered", "ERR", "0-10m", 0.13, 0.05),
        row("unfiltered", "ERR", "from_above", 0.11, 0.05),
    ]
    first, ranges, second, *_ = distance_table(rows, NAMES).rows
    assert [plain(cell) for cell in first[1:3]] == ["10.0", f"{UNSURE}10.0"]
    assert plain(ranges[1]) == "8.0\N{EN DASH}11.0"
    assert [plain(cell) for cell in second[1:3]] == ["13.0", "11.0"]
    brief = distance_table(rows, NAMES, brief=True)
    assert brief.columns == ["ERR, %", "0\N{EN DASH}10 m", "by area"]
    assert [plain(cell) for cell in brief.rows[0][1:]] == ["10.0", f"{UNSURE}10.0"]
    assert f"{UNSURE}: a small error" in brief.caption


def test_an_interval_of_errors_ends_at_what_an_error_can_be():
    wrong = np.arange(40) % 20 == 0  # one frame in twenty, all of it
    words = {"variant": "filtered", "stage": "post", "region": "0-10m"}
    rows = pd.DataFrame({**words, "N": 9, "FP": 9 * wrong, "FN": 0})
    found = some_findings(table=lambda _: rows).by_distance
    mean, low, high = found["0-10m", "filtered"]
    assert (mean, low) == (0.05, 0.0)
    assert 0.05 < high < 1


def test_a_heat_map_has_zeros_where_no_row_is_and_tells_places_that_are_never_labelled():
    columns = ["variant", "top", "left", "side", "labelled", "FP", "FN"]
    rows = [("net", 0, 8, 8, 20, 5, 1), ("net", 8, 0, 8, 0, 0, 0), ("net", 8, 16, 8, 20, 0, 0)]
    table = pd.DataFrame(rows, columns=columns)
    (shares,) = some_findings(table=lambda _: table).heatmaps.values()
    nan = math.nan
    expected = [[[0, 0.25, 0], [nan, 0, 0]], [[0, 0.05, 0], [nan, 0, 0]]]
    np.testing.assert_equal(shares, np.array(expected))


def headings(made):
    return [block.text for block in made.blocks if isinstance(block, Heading) and block.level == 1]


def test_a_page_has_the_sections_of_the_report():
    drive = findings()
    parts = {"filtered": {"svm": 0.2, "post": -0.1}}
    vars(drive).update(regions=of_regions("interior"), error_parts=parts)
    frames = FrameBrowser([], [], [])
    paper, page = (headings(made) for made in (document(drive), page_document(drive, frames)))
    assert "Over thresholds" in page
    assert {*paper} - {*page} == {"The worst frames of filtered"}


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    table = a_table({("filtered", "post"): [10] * frames}).assign(drive="street", camera="")
    tables = {"frames": table, "windows": read_table("windows", "")}
    windows = Findings("drive.rrd", some_findings().facts, tables.__getitem__).windows
    assert set(windows["frames"][:-1]) == {size}
    assert len(windows) == rows
    assert windows["frames"].sum() == frames


def test_a_variant_has_one_mark_in_tables_and_charts():
    findings = some_findings()
    marks = {row[0].text: row[0].look for row in rates_table(findings.facts).rows}
    for chart in charts.stages(findings.facts.totals):
        assert {series.name: series.look for series in chart.series} == marks


def test_bold_is_the_best_and_nothing_else():
    effect = Effect("unfiltered", "filtered", "post", True, by_rate(err=a_difference(-0.02)))
    facts = some_findings(effects=[effect]).facts
    tables = stages_table(facts.totals), differences_table(facts)
    cells = [cell for table in tables for row in table.rows for cell in row]
    assert [cell for cell in cells if isinstance(cell, Cell) and cell.bold] == []


@pytest.mark.parametrize(
    ("claims", "title"),
    [
        ({"filter_ERR": {"held": 1, "windows": 2}}, "The paper's claims, and its figures"),
        ({}, "Masks and rates along the drive"),
    ],
)
def test_figures_are_the_paper_s_if_its_pipeline_ran_and_a_short_last_point_is_said(claims, title):
    table = a_table({("net", "post"): [10] * 14}).assign(drive="street", camera="")
    tables = {"frames": table, "windows": windows(table, 10)}
    _, details = over_drive(some_findings(claims=claims, table=tables.get))
    assert details.title.startswith(title)
    first, *others = (block for block in details.blocks if isinstance(block, Figure))
    assert "each point is the mean of 10 frames, the last one of 4." in first.caption
    assert not any("point" in figure.caption for figure in others)


@pytest.mark.parametrize(("variant", "told"), [("unfiltered", True), ("net", False)])
def test_the_preset_is_told_if_its_chain_ran(variant, told):
    found = some_findings(run={"preset": "paper"}, settings={variant: {}})
    assert ("preset paper" in document(found).subtitle) == told


def test_without_truth_the_final_masks_are_large_and_of_the_steps_those_of_one_variant():
    image = np.zeros((4, 6, 3), np.uint8)
    rows = [[LayerImage(f"{name}: svm", image), LayerImage("post", image)] for name in ("a", "b")]
    shown = NotableFrame(3, 0, "", {}, images=[LayerImage("camera", image)], layers=rows)
    grids = [b for b in notable_frame(some_findings(), shown) if isinstance(b, ImageGrid)]
    titles = [[title for title, _ in grid.pictures] for grid in grids]
    assert titles == [["camera", "a: road", "b: road"], ["a: svm"]]


# --- When a mask fails: what a report says of slices that hold, of none, and of too few frames ----


SHADE = Slice(
    *([FrameCondition("shadow", ">", 0.3)], "20-80m", 45, 0.31, 0.1, 3.1, 1.8, 4.9, 0.01, [12, 40])
)


def blocks(frames: int = 90, level: int = 1, **slices: list[Slice]):
    account = FrameAccount(evaluated=frames)
    return [*when_it_fails(some_findings(slices=slices, frames=account), level)]


def test_a_slice_is_a_sentence_a_row_and_links_to_its_worst_frames():
    section = blocks(filtered=[SHADE])
    assert section[1].text == (
        "In frames with more than 30 % shade, 20 to 80 m ahead, ERR is 3.1 times the rest "
        "(1.8 to 4.9)."
    )
    place = "in frames with more than 30 % shade, 20 to 80 m ahead"
    row = [place, "45", "31.00", "10.00", "3.1 (1.8 to 4.9)", "12, 40"]
    assert plain_rows(the(Table, section)) == [row]
    assert the(Table, section).rows[0][-1].frames == [12, 40]
    assert not the(Table, blocks(level=2, filtered=[SHADE])).rows[0][-1].frames


@pytest.mark.parametrize(
    ("frames", "slices", "begin"),
    [(90, {"filtered": []}, "No condition is confirmed."), (39, {}, "Too little")],
)
def test_where_no_slice_holds_a_sentence_says_so(frames, slices, begin):
    heading, sentence = blocks(frames, **slices)
    assert isinstance(heading, Heading)
    assert isinstance(sentence, Text)
    assert sentence.text.startswith(begin)


def test_a_result_in_which_nothing_was_searched_has_no_section():
    assert blocks(90) == []


@pytest.mark.parametrize("slices", [{}, {"mine": []}, {"mine": [SHADE, replace(SHADE, part="")]}])
def test_slices_are_read_back_as_they_were_written(slices):
    facts = Facts.parse(facts_of(slices=slices).text(), "here")
    assert facts.slices == slices
    assert ("slices" in json.loads(facts.text())) == bool(slices)


def test_drives_of_one_day_count_as_one(tmp_path):
    fleet = FleetFolder(fleet_of(tmp_path / "week", 14, status=lambda _: SCORED))
    fleet.drives["group"] = fleet.drives["drive"]
    assert [*when_it_fails(fleet)] == []  # made before conditions were measured
    fleet.drives["group"] = "monday"
    _, sentence = when_it_fails(fleet)
    assert sentence.text.startswith("Too little")
    assert sentence.text.endswith("needs 12 groups of drives.")


# --- The report of a fleet: what it says, and how it grows ----------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Twelve drives: one failed, one is without truth, one has lost a part."""
    return fleet_of(tmp_path_factory.mktemp("fleet") / "street", 12, pictures=12)


@pytest.fixture(scope="module")
def fleet(folder):
    return FleetFolder(folder)


def opened_blocks(section, fleet):
    return opened(section(fleet))


def tables(section, fleet):
    return [block for block in opened_blocks(section, fleet) if isinstance(block, Table)]


def test_the_first_page_has_the_verdict_the_rates_and_the_differences(fleet):
    told = opened_blocks(drives.summary, fleet)
    assert fleet.facts.verdict in [b.text for b in told if isinstance(b, Text)]
    rates, effects = tables(drives.summary, fleet)
    assert [row[0] for row in plain_rows(rates)] == ["filtered", "unfiltered", "blind"]
    first, *others = (own["post"] for own in fleet.facts.totals.values())
    assert plain_rows(rates)[0][1:4] == ["10", "200", f"{100 * first['ERR']:.2f}"]
    bold = [cell.text for row in rates.rows for cell in row[3:4] if cell.bold]
    assert bold == [f"{100 * min(r['ERR'] for r in (first, *others)):.2f}"]
    assert plain_rows(effects)[0][0] == "filtered \N{MINUS SIGN} unfiltered"
    assert len(effects.rows) == 3
    assert effects.groups[-1] == ("drives", 2)


def test_the_regions_of_all_drives_are_drawn(fleet):
    (figure,) = (each for each in opened_blocks(drive.regions, fleet) if isinstance(each, Figure))
    final = Result(fleet.path).scores.query("final and region != 'all'")
    sums = final.groupby(["variant", "region"])[["FP", "FN", "N"]].sum()
    assert len(figure.charts[0].names) == fleet.regions.index.unique("region").size > 0
    for (region, variant), own in fleet.regions.iterrows():
        counted = sums.loc[(variant, region)]
        assert own["ERR"] == pytest.approx((counted.FP + counted.FN) / counted.N)


def test_the_worst_frames_have_pictures_and_missing_ones_are_named(folder, fleet, tmp_path):
    grid = the(
        ImageGrid, [b for b in opened_blocks(drives.worst, fleet) if isinstance(b, ImageGrid)]
    )
    assert len(grid.pictures) == 12
    first = fleet.worst.iloc[0]
    name = f"{fleet.names[first['drive']]}, frame {first['frame']}"
    assert grid.pictures[0][0].startswith(f"1. {name}")
    copy = shutil.copytree(folder, tmp_path / "copy")
    picture = copy / "pictures" / first["drive"] / f"{first['frame']}.jpg"
    picture.write_bytes(picture.read_bytes()[:50])
    told = opened_blocks(drives.worst, (FleetFolder(copy)))
    assert len(told[1].pictures) == 11
    assert "Not in the folder: 1 picture." in told[2].text
    limits = f"at most {OF_A_DRIVE} frames of a drive, at least {APART_NS // 10**9} seconds apart"
    assert limits in told[2].text


def test_a_report_lands_in_the_fleets_folder_and_is_the_same_each_time(folder):
    path = write_report(folder)
    assert path == folder / "report.pdf"
    first = path.read_bytes()
    assert "What the filter changes" in text(first)
    assert write_report(folder).read_bytes() == first


def test_a_fleet_in_which_every_drive_failed_has_a_report(tmp_path):
    fleet = fleet_of(tmp_path / "f", 2, status=lambda _: FAILED)
    told = text(write_report(fleet).read_bytes())
    assert "Drives that failed: 2" in told
    assert "Nothing to score: no frame with truth was evaluated." in told


def test_two_drives_of_one_name_are_told_apart(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "copy")
    found = FleetFolder(copy)
    drives_ = [replace(each, name="same") for each in found.facts.drives]
    assert len({each.drive for each in drives_}) == 12
    (copy / "fleet.json").write_text(replace(found.facts, drives=drives_).text())
    names = (FleetFolder(copy)).names
    assert len(set(names.values())) == 12


# --- The captions in Markdown, and the code that shows them ---------------------------------------


FOLDER = Path(roadeval.report.__file__).parent
PYTHON, TEMPLATES = (
    "\n".join(path.read_text("utf-8") for path in sorted(FOLDER.rglob(pattern)))
    for pattern in ("*.py", "*.html")
)


def test_every_caption_is_shown_and_every_shown_one_is_there() -> None:
    code = (PYTHON + TEMPLATES).replace("'", '"')
    assert [name for name in captions() if f'"{name}"' not in code] == []
    shown = re.findall(r'\b(?:caption|note)\(\s*"([^"]+)"', code)
    assert {*shown} <= captions().keys()


def test_a_caption_is_one_line_with_its_values() -> None:
    assert caption("units") == "Percent; the differences in percentage points."
    assert caption("failed drives", failed=2, drives=9).startswith("2 of 9 drives failed")
    assert not any("\n" in words for words in captions().values())
