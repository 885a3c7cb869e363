"""Whole drives, from the log to tables and recording, with the numbers they must give."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from roadeval import Recording
from tests.e2e.commands import CLASSES, Replayed, replay
from tests.fixtures.make import make
from tests.fixtures.shared import SHARED
from tests.recording.making import paths_of

FIGURES = [
    f"{figure}.{suffix}"
    for figure in ("fig2_masks", "fig3a_error_rate", "fig3b_fp_fn_rate")
    for suffix in ("pdf", "png")
]
TABLES = [
    *("frames.csv", "windows.csv", "regions.csv", "summary.json", "run.toml"),
    *("changes.csv", "conditions.csv", "disagreements.csv", "heat.csv", "oracles.csv", "parts.csv"),
]


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


@pytest.mark.parametrize(
    ("drive", "files"),
    [("demo", FIGURES + TABLES), ("street", TABLES), ("car_park", TABLES)],
    ids=["demo", "street", "car_park"],
)
def test_a_labelled_drive_gives_a_recording_tables_and_figures(drive, files, request):
    """100 frames of the demo, 30 of the others, whose figures are not drawn."""
    labelled = request.getfixturevalue(drive)
    assert labelled.run.returncode == 0, labelled.run.stderr
    assert labelled.recording.is_file()
    assert sorted(file.name for file in labelled.reports.iterdir()) == sorted(files)


def test_a_real_drive_has_101_frames_and_10_windows(real):
    _, replayed = real
    assert replayed.run.returncode == 0, replayed.run.stderr
    frames = replayed.summary["frames"]
    assert (frames["read"], frames["trained_on"], frames["evaluated"]) == (101, 10, 91)
    assert replayed.summary["windows"] == 10
    assert len({row["window"] for row in replayed.table("windows")}) == 10
    assert "91 of 101 frames were evaluated. Left" in replayed.run.stdout


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


RERUN = Path(sys.executable).with_name("rerun")


def rerun(*words):
    """Run Rerun's own tool."""
    run = subprocess.run(
        [RERUN, "rrd", *map(str, words)], capture_output=True, text=True, check=False, timeout=120
    )
    return run.returncode, run.stdout + run.stderr


def truths_of(drive):
    """The truth of each frame: true for road, false for none, masked where it is ignored."""
    with drive.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=["/front/road_mask"]):
            labels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
            yield np.ma.masked_array(labels == 255, labels == 128)


def test_the_recorded_masks_scored_against_the_log_give_the_table(car_park, tmp_path):
    truths = list(truths_of(make("drives/car_park.mcap", tmp_path)))
    recording = Recording(car_park.recording)
    rows = [row for row in car_park.table("frames") if row["variant"] != "blind"]
    assert len(rows) == 20 * 6
    for row in rows:
        frame = int(row["frame"])
        road, truth = recording.layer(row["variant"], row["stage"], frame) == 1, truths[frame]
        found = [
            int(np.ma.sum(outcome))
            for outcome in (road & truth, ~road & ~truth, road & ~truth, ~road & truth)
        ]
        assert found == [int(row[name]) for name in ("TP", "TN", "FP", "FN")]
        assert float(row["ERR"]) == (found[2] + found[3]) / truth.count()


@pytest.mark.parametrize("drive", ["demo", "unlabelled"])
def test_rerun_finds_no_fault_with_the_file(drive, request):
    code, said = rerun("verify", request.getfixturevalue(drive).recording)
    assert code == 0, said


@pytest.fixture(scope="module")
def twice(at_home, tmp_path_factory):
    """The recordings and the tables of one drive, replayed by two workers and by one."""
    _, home = at_home
    folder = tmp_path_factory.mktemp("alone")
    alone = replay(folder, home / "drives" / "street.mcap", *CLASSES, "--jobs", 1)
    return [
        (home / "recordings" / "street.rrd", home / "reports" / "street"),
        (alone.recording, alone.reports),
    ]


def plain_summary(reports):
    """Return a summary without what took how long, and without how many workers there were."""
    summary = json.loads((reports / "summary.json").read_text())
    return {key: value for key, value in summary.items() if key not in ("seconds", "run", "origin")}


def test_two_runs_give_the_same_summary_but_for_the_clock_and_what_was_asked(twice):
    two, one = (plain_summary(reports) for _, reports in twice)
    assert one == two


def test_two_runs_give_the_same_recording_but_for_the_clock(twice, tmp_path):
    for number, (recording, _) in enumerate(twice):
        clocked = [path for path in paths_of(recording) if path.startswith("/timing/")]
        paths = (*clocked, "/results/summary", "/results/run")
        dropped = [word for path in paths for word in ("--drop-entity", path)]
        code, said = rerun("filter", *dropped, recording, "-o", tmp_path / f"{number}.rrd")
        assert code == 0, said
    code, said = rerun("compare", "--unordered", tmp_path / "0.rrd", tmp_path / "1.rrd")
    assert code == 0, said
