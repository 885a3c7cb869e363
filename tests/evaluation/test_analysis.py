"""What the tables say when they are read again."""

import io
import math
from dataclasses import asdict

import pandas as pd
import pytest

from roadeval.data import Role
from roadeval.evaluation import analysis
from roadeval.evaluation.baselines import BlindPrior
from roadeval.evaluation.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.lines import lines as lines_of
from roadeval.results.schema import TABLES
from tests.evaluation.making import a_frame, a_table, a_variant, pixels

POST, SVM = ("filtered", "post"), ("filtered", "svm")
CONTROL_POST, CONTROL_SVM = ("unfiltered", "post"), ("unfiltered", "svm")


def scored() -> tuple[Scoreboard, pd.DataFrame]:
    """A drive of 12 frames with its scoreboard, and what its ``frames.csv`` reads as."""
    settings = EvaluationSettings(window=5, boundary_width=1, bands=2)
    truth = pixels("##..", "##.?")
    board = Scoreboard(settings, ["filtered"], BlindPrior.of_truths([truth]))
    lines = TABLES["frames"].header
    for number in range(12):
        mask = pixels("#..." if number % 3 else "###.", "....")
        masks = {"svm": truth % 2, "post": mask}
        result = board.score(
            a_frame(truth, number), Role.EVALUATED, (a_variant("filtered", masks),)
        )
        board.add(result)
        lines += lines_of(result)["frames"]
    return board, pd.read_csv(io.StringIO(lines))


def test_totals_of_the_table_are_those_of_the_run():
    board, frames = scored()
    assert analysis.totals(frames) == board.totals()


def test_totals_keep_the_table_s_order():
    table = a_table({("wide", "svm"): [1], ("wide", "post"): [1], ("blind", "post"): [1]})
    totals = analysis.totals(table)
    assert [*totals] == ["wide", "blind"]
    assert [*totals["wide"]] == ["svm", "post"]


def test_windows_of_the_table_are_those_of_the_run():
    board, frames = scored()
    found = [asdict(window) for window in analysis.windows(frames, 5)]
    told = [asdict(window) for window in board.windows()]
    assert sorted(map(str, found)) == sorted(map(str, told))


def test_the_final_stage_is_post_or_else_the_last():
    frames = a_table({SVM: [1], POST: [1], ("mine", "net"): [1], ("mine", "crf"): [1]})
    assert analysis.final_stages(frames) == {"filtered": "post", "mine": "crf"}


def test_pairs_subtract_the_same_frames_only():
    frames = a_table({POST: [10, 20, 30], CONTROL_POST: [10, 25]})
    paired = analysis.pairs(frames, "filtered", "unfiltered")
    assert paired.index.tolist() == [0, 1]
    assert paired["ERR"].tolist() == pytest.approx([0, -0.05])
    assert paired["wrong"].tolist() == [0, -5]


def test_the_causes_of_an_error_add_up_to_it():
    frames = a_table({SVM: [30], POST: [12], CONTROL_SVM: [20], CONTROL_POST: [15]})
    filtered = analysis.causes(frames, "filtered").loc[0]
    assert filtered.to_dict() == pytest.approx({"svm": 0.20, "filter": 0.10, "post": -0.18})
    assert filtered.sum() == pytest.approx(0.12)
    unfiltered = analysis.causes(frames, "unfiltered").loc[0]
    assert unfiltered.to_dict() == pytest.approx({"svm": 0.20, "post": -0.05})


def test_a_variant_of_one_stage_has_one_cause():
    frames = a_table({("mine", "post"): [7], POST: [1]})
    assert analysis.causes(frames, "mine").loc[0].to_dict() == pytest.approx({"post": 0.07})


def test_where_err_is_undefined_on_every_frame_its_causes_are_undefined_too():
    table = a_table({key: [0, 0] for key in (SVM, POST, CONTROL_SVM, CONTROL_POST)})
    found = analysis.causes(table.assign(ERR=math.nan), "filtered")
    assert found.columns.tolist() == ["svm", "filter", "post"]
    assert found.index.tolist() == [0, 1]
    assert found.isna().all(axis=None)


def test_of_neighbouring_bad_frames_only_the_worst_is_picked():
    frames = a_table({POST: [*[0] * 10, 40, 50, 45, *[0] * 10, 30]}, hertz=10)
    second = 1_000_000_000
    assert analysis.worst(frames, "filtered", 2, apart_ns=second)["frame"].tolist() == [11, 23]
    assert analysis.worst(frames, "filtered", 2, apart_ns=0)["frame"].tolist() == [11, 12]


def test_neighbours_are_a_thirtieth_of_the_drive_apart_and_at_most_a_second():
    errors = [40, 50, 45, *[0] * 57, 30]
    short, long = a_table({POST: errors}, hertz=10), a_table({POST: errors}, hertz=0.1)
    assert analysis.worst(short, "filtered", 3)["frame"].tolist() == [1, 60, 3]
    assert analysis.worst(long, "filtered", 3)["frame"].tolist() == [1, 2, 0]


def test_frames_that_changed_most_are_those_that_changed_at_all():
    frames = a_table({POST: [10, 30, 10], CONTROL_POST: [10, 10, 15]}, hertz=1)
    paired = analysis.pairs(frames, "filtered", "unfiltered")
    assert analysis.most_changed(paired, 5, harmed=True)["frame"].tolist() == [1]
    assert analysis.most_changed(paired, 5, harmed=False)["frame"].tolist() == [2]


def test_a_region_tells_its_share_of_the_pixels_and_of_the_errors():
    regions = pd.DataFrame(
        [
            (0, "filtered", "post", "boundary", 5, 0, 5, 0, 10),
            (0, "filtered", "post", "interior", 40, 45, 5, 0, 90),
            (0, "filtered", "post", "shadow", 0, 0, 0, 0, 0),
        ],
        columns=list(TABLES["regions"].names),
    )
    found = analysis.by_region(regions).set_index("region")
    assert found.loc["boundary", "ERR"] == 0.5
    assert found["pixels"].tolist() == pytest.approx([0.1, 0.9, 0.0])
    assert found["errors"].tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert pd.isna(found.loc["shadow", "ERR"])


def test_settings_of_another_version_are_read_as_far_as_they_are_known():
    evaluation = {"evaluation": {"window": 7, "from_the_future": 1}}
    assert analysis.settings_of({"run": evaluation}) == EvaluationSettings(window=7)
    assert analysis.settings_of({}) == EvaluationSettings()
