"""Whole drives, from the log to the tables, with the numbers they must give."""

import pytest

from roadeval import Recording
from tests.e2e.commands import CLASSES, Replayed, replay
from tests.fixtures.shared import SHARED

FIGURES = [
    f"{figure}.{suffix}"
    for figure in ("fig2_masks", "fig3a_error_rate", "fig3b_fp_fn_rate")
    for suffix in ("pdf", "png")
]
TABLES = [
    *("frames.csv", "windows.csv", "regions.csv", "summary.json", "run.toml"),
    *("changes.csv", "disagreements.csv", "heat.csv", "oracles.csv"),
]


@pytest.fixture(params=["demo", "street", "car_park"])
def labelled(request):
    """Each drive with truth: 100 frames of the demo, 30 of the others."""
    return request.getfixturevalue(request.param)


@pytest.fixture(
    scope="module",
    params=[("camvid_0016E5_15hz", *CLASSES), ("camvid_0006R0_1hz",)] if SHARED else [],
    ids=lambda words: words[0],
)
def real(request, once):
    """The tables of a real drive of 101 frames; pictures and figures are looked at elsewhere."""
    name, *labels = request.param
    drive = SHARED / "drives" / f"{name}.mcap"
    words = (*labels, "--record", "none")
    return name, Replayed(*once(name, lambda folder: replay(folder, drive, *words).run))


def pooled_error(replayed, variant, stage="post"):
    return replayed.summary["totals"][variant][stage]["pooled_ERR"]


def test_a_labelled_drive_gives_a_recording_tables_and_figures(labelled):
    assert labelled.run.returncode == 0, labelled.run.stderr
    assert labelled.recording.is_file()
    assert sorted(file.name for file in labelled.reports.iterdir()) == sorted(FIGURES + TABLES)


def test_a_real_drive_has_101_frames_and_10_windows(real):
    _, replayed = real
    assert replayed.run.returncode == 0, replayed.run.stderr
    frames = replayed.summary["frames"]
    assert (frames["read"], frames["trained_on"], frames["evaluated"]) == (101, 10, 91)
    assert replayed.summary["windows"] == 10
    assert len({row["window"] for row in replayed.table("windows")}) == 10
    assert "91 of 101 frames were evaluated, in 10 windows. Left" in replayed.run.stdout


def test_the_unfiltered_pipeline_does_what_a_prototype_did(real):
    name, replayed = real
    limits = {"camvid_0016E5_15hz": 0.12, "camvid_0006R0_1hz": 0.09}
    assert pooled_error(replayed, "unfiltered") < limits[name]


def test_a_drive_without_truth_gives_masks_and_says_that_nothing_is_scored(unlabelled):
    assert unlabelled.run.returncode == 0, unlabelled.run.stderr
    assert "Nothing to score" in unlabelled.run.stdout
    assert [file.name for file in unlabelled.reports.glob("*.csv")] == ["unlabelled.csv"]
    assert unlabelled.summary["totals"] == {}
    masks = Recording(unlabelled.recording).layer("unfiltered", "post", 14)
    assert masks.shape == (72, 96)
