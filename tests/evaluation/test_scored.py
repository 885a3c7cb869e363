"""What the rows of frames say by themselves."""

from typing import Any

import numpy as np
import pytest

from roadeval.data import Counts, Health, Role, Rows
from roadeval.evaluation import metrics, score
from roadeval.evaluation.score import BlindPrior, Scoreboard, evidence, judge
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.schema import TABLES
from roadeval.results.tables import read_rows
from tests.evaluation.making import a_frame, a_table, a_variant, pixels, rows_of
from tests.results.making import lines as lines_of

POST, SVM = ("filtered", "post"), ("filtered", "svm")
CONTROL_POST, CONTROL_SVM = ("unfiltered", "post"), ("unfiltered", "svm")


def scored_drive() -> tuple[Scoreboard, Rows]:
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
    return board, read_rows("frames", lines)


def test_totals_of_the_table_are_those_of_the_run():
    board, frames = scored_drive()
    assert score.totals(score.camera_masks(frames)) == board.totals()


def test_the_final_stage_is_post_or_else_the_last():
    rows = rows_of(a_table({SVM: [1], POST: [1], ("mine", "net"): [1], ("mine", "crf"): [1]}))
    found = score.finals(rows)
    assert [*zip(found["variant"], found["stage"], strict=True)] == [POST, ("mine", "crf")]


def test_windows_of_the_table_are_those_of_the_run():
    board, frames = scored_drive()
    found = score.windows(score.camera_masks(frames), 5)
    assert [*map(str, found)] == [*map(str, board.windows())]


def test_the_causes_of_an_error_add_up_to_it():
    frames = rows_of(a_table({SVM: [30], POST: [12], CONTROL_SVM: [20], CONTROL_POST: [15]}))
    filtered = score.causes(frames, "filtered").of(0)
    assert filtered == pytest.approx({"svm": 0.20, "filter": 0.10, "post": -0.18})
    assert sum(filtered.values()) == pytest.approx(0.12)
    unfiltered = score.causes(frames, "unfiltered").of(0)
    assert unfiltered == pytest.approx({"svm": 0.20, "post": -0.05})


def test_neighbours_are_a_thirtieth_of_the_drive_apart_and_at_most_a_second():
    errors = [40, 50, 45, *[0] * 57, 30]
    short, long = (rows_of(a_table({POST: errors}, hertz=hertz)) for hertz in (10, 0.1))
    assert score.worst(short, "filtered", 3)["frame"].tolist() == [1, 60, 3]
    assert score.worst(long, "filtered", 3)["frame"].tolist() == [1, 2, 0]


SECONDS = np.arange(4) * 1_000_000_000


@pytest.mark.parametrize(("harmed", "places"), [(True, [2, 1]), (False, [3])])
def test_frames_that_changed_most_are_those_that_changed_at_all(harmed, places):
    changes = np.array([0, 0.1, 0.2, -0.1])
    assert score.most_changed(SECONDS, changes, 5, harmed=harmed).tolist() == places


# --- When a frame is fine, degraded or failed -----------------------------------------------------


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


@pytest.mark.parametrize(("percent", "health"), [(15, Health.DEGRADED), (25, Health.FAILED)])
def test_many_errors_degrade_and_more_fail(percent: int, health: Health) -> None:
    assert judge(with_error(percent), None) is health


def test_finding_next_to_no_road_fails_however_little_there_is() -> None:
    missed = metrics.of(Counts(tp=0, tn=95, fp=0, fn=5))
    assert judge(missed, None) is Health.FAILED


def test_a_frame_without_road_fails_by_its_errors_only() -> None:
    assert judge(metrics.of(Counts(tn=100)), None) is Health.OK
    assert judge(metrics.of(Counts(tn=70, fp=30)), None) is Health.FAILED


@pytest.mark.parametrize(("blind", "health"), [(7, Health.OK), (5, Health.DEGRADED)])
def test_losing_to_blind_by_more_than_the_margin_degrades(blind: int, health: Health) -> None:
    assert judge(with_error(8), with_error(blind)) is health


# --- The paper's claims, on windows written by hand -----------------------------------------------

NAN = float("nan")


def counted(held: int, windows: int, short_held: int, short: int) -> dict[str, int]:
    return {"held": held, "windows": windows, "short_held": short_held, "short": short}


def windows(variant: str, stage: str, errs: list[float], frames: list[int]) -> list[dict[str, Any]]:
    """Windows of a mask: the same value for every rate."""
    return [
        {"window": number, "frames": count, "variant": variant, "stage": stage}
        | dict.fromkeys(("ERR", "FPR", "FNR"), err)
        for number, (err, count) in enumerate(zip(errs, frames, strict=True))
    ]


def test_full_windows_and_shorter_ones_are_counted_apart() -> None:
    frames = [10, 10, 10, 3]
    found = evidence(
        windows("filtered", "post", [0.1, 0.3, 0.1, 0.1], frames)
        + windows("unfiltered", "post", [0.2, 0.2, 0.2, 0.2], frames),
        size=10,
    )
    assert found["filter_ERR"] == counted(2, 3, 1, 1)


def test_equal_rates_do_not_bear_a_claim_out() -> None:
    with_filter = windows("filtered", "post", [0.2], [10])
    without = windows("unfiltered", "post", [0.2], [10])
    assert evidence(with_filter + without, 10)["filter_FPR"] == counted(0, 1, 0, 0)


def test_a_window_where_a_rate_is_undefined_is_in_no_count() -> None:
    found = evidence(
        windows("filtered", "post", [0.1, NAN], [10, 10])
        + windows("unfiltered", "post", [0.2, 0.2], [10, 10]),
        size=10,
    )
    assert found["filter_FNR"] == counted(1, 1, 0, 0)


def test_stages_are_held_against_those_before_them() -> None:
    found = evidence(
        windows("filtered", "similarity", [0.3], [10])
        + windows("filtered", "svm", [0.2], [10])
        + windows("filtered", "post", [0.25], [10]),
        size=10,
    )
    assert found == {"svm_ERR": counted(1, 1, 0, 0), "post_ERR": counted(0, 1, 0, 0)}


# --- What a report makes of the tables ------------------------------------------------------------


@pytest.mark.parametrize(
    ("chains", "order"),
    [
        ([("svm", "post"), ("trees", "post")], ["svm", "trees", "post"]),
        ([("net", "post"), ("svm", "post", "smooth")], ["net", "svm", "post", "smooth"]),
        ([("svm",), ("net",)], ["svm", "net"]),
        ([("a", "b"), ("b", "a")], ["a", "b"]),
        ([], []),
    ],
)
def test_stages_of_several_chains_stand_in_the_order_of_each(chains, order):
    assert score.merged(chains) == order
