"""What the rows of frames say by themselves."""

import math
from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from roadeval.data import Counts, Health, Role, Rows
from roadeval.evaluation import metrics, score
from roadeval.evaluation.score import CLAIMS, BlindPrior, Scoreboard, Window, evidence, judge
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.schema import TABLES
from roadeval.results.sentences import CLAIMED
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
    assert score.totals(frames) == board.totals()


def test_totals_keep_the_table_s_order():
    table = rows_of(a_table({("wide", "svm"): [1], ("wide", "post"): [1], ("blind", "post"): [1]}))
    totals = score.totals(table)
    assert [*totals] == ["wide", "blind"]
    assert [*totals["wide"]] == ["svm", "post"]


def test_the_final_stage_is_post_or_else_the_last():
    rows = rows_of(a_table({SVM: [1], POST: [1], ("mine", "net"): [1], ("mine", "crf"): [1]}))
    assert score.stages_of(rows) == {"filtered": "post", "mine": "crf"}


def test_the_rows_of_final_masks_keep_their_order_in_the_table():
    rows = rows_of(a_table({SVM: [1, 2], POST: [3, 4], ("mine", "net"): [5, 6]}))
    mixed = rows.take(np.array([4, 2, 0, 3, 1, 5]))
    found = score.finals(mixed)
    assert found["FP"].tolist() == [4, 5, 3, 6]
    assert found["variant"].tolist() == ["filtered", "mine", "filtered", "mine"]
    assert len(score.finals(rows.take(slice(0)))) == 0


def test_a_window_holds_the_frames_of_the_mask_that_has_most():
    cells = {"window": [1, 0, 1, 0], "frames": [7, 10, 9, 8], "variant": ["a", "a", "b", "b"]}
    each = score.each_window(Rows({name: np.array(values) for name, values in cells.items()}))
    assert each["window"].tolist() == [0, 1]
    assert each["frames"].tolist() == [10, 9]


def test_windows_of_the_table_are_those_of_the_run():
    board, frames = scored_drive()
    found = [asdict(window) for window in score.windows(frames, 5)]
    told = [asdict(window) for window in board.windows()]
    assert sorted(map(str, found)) == sorted(map(str, told))


def test_the_causes_of_an_error_add_up_to_it():
    frames = rows_of(a_table({SVM: [30], POST: [12], CONTROL_SVM: [20], CONTROL_POST: [15]}))
    filtered = score.causes(frames, "filtered").of(0)
    assert filtered == pytest.approx({"svm": 0.20, "filter": 0.10, "post": -0.18})
    assert sum(filtered.values()) == pytest.approx(0.12)
    unfiltered = score.causes(frames, "unfiltered").of(0)
    assert unfiltered == pytest.approx({"svm": 0.20, "post": -0.05})


def test_a_variant_of_one_stage_has_one_cause():
    frames = rows_of(a_table({("mine", "post"): [7], POST: [1]}))
    assert score.causes(frames, "mine").of(0) == pytest.approx({"post": 0.07})


def test_where_err_is_undefined_on_every_frame_its_causes_are_undefined_too():
    table = rows_of(a_table({key: [0, 0] for key in (SVM, POST, CONTROL_SVM, CONTROL_POST)}))
    found = score.causes(table.replace(ERR=np.full(len(table), math.nan)), "filtered")
    assert [*found.parts] == ["svm", "filter", "post"]
    assert found.frames.tolist() == [0, 1]
    assert np.isnan([*found.parts.values()]).all()
    assert np.isnan([*found.means().values()]).all()


def test_the_mean_of_a_cause_is_that_of_the_frames_on_which_it_is_known():
    frames = rows_of(a_table({("mine", "net"): [10, 20, 30], ("mine", "post"): [10, 10]}))
    assert score.causes(frames, "mine").means() == pytest.approx({"net": 0.2, "post": -0.05})


def test_of_neighbouring_bad_frames_only_the_worst_is_picked():
    frames = rows_of(a_table({POST: [*[0] * 10, 40, 50, 45, *[0] * 10, 30]}, hertz=10))
    second = 1_000_000_000
    assert score.worst(frames, "filtered", 2, apart_ns=second)["frame"].tolist() == [11, 23]
    assert score.worst(frames, "filtered", 2, apart_ns=0)["frame"].tolist() == [11, 12]


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


@pytest.mark.parametrize("harmed", [True, False])
def test_a_change_that_is_undefined_is_none(harmed):
    changes = np.array([math.nan] * 4)
    assert not len(score.most_changed(SECONDS, changes, 5, harmed=harmed))


# --- When a frame is fine, degraded or failed -----------------------------------------------------


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_few_errors_are_fine() -> None:
    assert judge(with_error(14), None) is Health.OK


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


def windows(variant: str, stage: str, errs: list[float], frames: list[int]) -> list[Window]:
    """Windows of a mask: the same value for every rate."""
    return [
        Window(number, 0, 0, count, variant, stage, dict.fromkeys(("ERR", "FPR", "FNR"), err), {})
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


def test_every_claim_has_words() -> None:
    assert [*CLAIMS] == [*CLAIMED]


# --- What a report makes of the tables ------------------------------------------------------------


def test_pairs_subtract_the_same_frames_only():
    frames = a_table({POST: [10, 20, 30], CONTROL_POST: [10, 25]})
    paired = score.pairs(rows_of(frames), "filtered", "unfiltered")
    assert paired["frame"].tolist() == [0, 1]
    assert paired["ERR"].tolist() == pytest.approx([0, -0.05])
    assert paired["wrong"].tolist() == [0, -5]


def test_a_region_tells_its_share_of_the_pixels_and_of_the_errors():
    regions = pd.DataFrame(
        [
            (0, "filtered", "post", "boundary", 5, 0, 5, 0, 10),
            (0, "filtered", "post", "interior", 40, 45, 5, 0, 90),
            (0, "filtered", "post", "shadow", 0, 0, 0, 0, 0),
        ],
        columns=list(TABLES["regions"].names[2:]),
    )
    found = score.by_region(rows_of(regions))
    assert [*found] == [(name, "filtered") for name in ("boundary", "interior", "shadow")]
    boundary, _, shadow = found.values()
    assert boundary["ERR"] == 0.5
    assert [each["pixels"] for each in found.values()] == pytest.approx([0.1, 0.9, 0.0])
    assert [each["errors"] for each in found.values()] == pytest.approx([0.5, 0.5, 0.0])
    assert math.isnan(shadow["ERR"])


def test_a_perfect_stage_is_judged_on_the_frames_that_have_both_masks():
    frames = a_table({("filtered", "svm"): [40, 40, 40], POST: [10, 20, 30]})
    oracles = a_table({("filtered", "svm"): [0, 0], POST: [4, 6]}).assign(oracle="svm")
    rows = rows_of(oracles).replace(oracle=rows_of(oracles)["oracle"].astype(str))
    (found,) = score.perfect_stages(rows, rows_of(frames))
    assert (found["variant"], found["oracle"], found["frames"]) == ("filtered", "svm", 2)
    assert (found["ERR"], found["as_is"]) == pytest.approx((0.05, 0.15))
    assert list(score.perfect_stages(rows.take(slice(0)), rows_of(frames))) == []


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
