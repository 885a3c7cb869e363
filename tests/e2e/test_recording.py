"""What the recording holds is what the tables say."""

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
from tests.e2e.commands import CLASSES, replay
from tests.fixtures.figures import drawn
from tests.fixtures.make import make
from tests.recording.making import paths_of

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
    with drawn():
        alone = replay(folder, home / "drives" / "street.mcap", *CLASSES, "--jobs", 1)
    return [
        (home / "recordings" / "street.rrd", home / "reports" / "street"),
        (alone.recording, alone.reports),
    ]


def plain_summary(reports):
    """Return a summary without what took how long, and without how many workers there were."""
    summary = json.loads((reports / "summary.json").read_text())
    return {key: value for key, value in summary.items() if key not in ("seconds", "run")}


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
