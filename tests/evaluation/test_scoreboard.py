"""A drive's score, from its frames to its sums."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from roadeval.data import Change, Counts, Health, Packed, Role
from roadeval.evaluation.score import (
    BlindPrior,
    CountsNotConservedError,
    Scoreboard,
    check_conserved,
)
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels

TRUTH = pixels("##..", "##.?")
FILTERED = a_variant(
    "filtered", {"svm": pixels("#...", "#..."), "post": pixels("##..", "#...")}, {"lit": TRUTH}
)
UNFILTERED = a_variant("unfiltered", {"svm": TRUTH, "post": pixels("##..", "##..")})

Counted = tuple[int, int, int, int]


def a_board(prior: BlindPrior | None = None, window: int = 10) -> Scoreboard:
    settings = EvaluationSettings(window=window, boundary_width=1, bands=2)
    return Scoreboard(settings, ["filtered", "unfiltered"], prior)


def a_drive(frames: int, board: Scoreboard) -> Scoreboard:
    for number in range(frames):
        frame = a_frame(TRUTH, number)
        board.add(board.score(frame, Role.EVALUATED, (FILTERED, UNFILTERED)))
    return board


def test_every_mask_of_every_variant_is_tallied_and_blind_comes_last() -> None:
    board = a_board(BlindPrior.of_truths([pixels("#...", "#...")]))
    result = board.score(a_frame(TRUTH), Role.EVALUATED, (FILTERED, UNFILTERED))
    assert [(tally.variant, tally.stage) for tally in result.tallies] == [
        ("filtered", "svm"),
        ("filtered", "post"),
        ("unfiltered", "svm"),
        ("unfiltered", "post"),
        ("blind", "post"),
    ]
    assert result.tallies[1].counts == Counts(tp=3, tn=3, fp=0, fn=1)
    assert result.tallies[1].rates["FNR"] == 0.25
    assert result.tallies[4].counts == Counts(tp=2, tn=3, fp=0, fn=2)


def test_all_masks_are_counted_in_the_regions_that_the_filter_found() -> None:
    result = a_board().score(a_frame(TRUTH), Role.EVALUATED, (FILTERED, UNFILTERED))
    for tally in result.tallies:
        assert list(tally.regions) == ["lit", "boundary", "interior", "band_0", "band_1"]


def test_error_maps_are_of_the_final_masks() -> None:
    result = a_board().score(a_frame(TRUTH), Role.EVALUATED, (FILTERED, UNFILTERED))
    assert result.errors["filtered"].array.tolist() == [[1, 1, 0, 0], [1, 3, 0, 4]]
    assert result.errors["unfiltered"].array.tolist() == [[1, 1, 0, 0], [1, 1, 0, 4]]


def test_scoring_changes_nothing() -> None:
    board = a_board()
    board.score(a_frame(TRUTH), Role.EVALUATED, (FILTERED,))
    assert board.totals() == {}
    assert board.roles() == {}


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_only_evaluated_frames_are_counted(role: Role) -> None:
    board = a_board()
    truth = None if role is Role.UNLABELLED else TRUTH
    result = board.score(a_frame(truth), role, (FILTERED,))
    board.add(result)
    assert result.tallies == ()
    assert board.roles() == {role: 1}
    assert board.totals() == {}


def test_health_is_judged_and_counted_by_final_masks() -> None:
    board = a_drive(3, a_board())
    result = board.score(a_frame(TRUTH), Role.EVALUATED, (FILTERED, UNFILTERED))
    assert result.health == {"filtered": Health.OK, "unfiltered": Health.OK}
    assert board.summary()["health"] == {"filtered": {"ok": 3}, "unfiltered": {"ok": 3}}


def test_totals_and_windows_follow_the_order_of_the_variants() -> None:
    board = a_drive(3, a_board(BlindPrior.of_truths([TRUTH]), window=2))
    assert list(board.totals()) == ["filtered", "unfiltered", "blind"]
    assert list(board.totals()["filtered"]) == ["svm", "post"]
    assert board.totals()["filtered"]["post"]["FN"] == 3
    assert [(row.number, row.variant, row.stage) for row in list(board.windows())[:5]] == [
        (0, "filtered", "svm"),
        (0, "filtered", "post"),
        (0, "unfiltered", "svm"),
        (0, "unfiltered", "post"),
        (0, "blind", "post"),
    ]
    assert board.summary()["windows"] == 2


def test_a_variant_may_not_be_called_blind() -> None:
    with pytest.raises(ValueError, match="blind"):
        Scoreboard(EvaluationSettings(), ["blind"], None)


def test_seconds_are_averaged_over_all_frames() -> None:
    board = a_drive(2, a_board())
    board.add(board.score(a_frame(None), Role.UNLABELLED, (FILTERED,)))
    assert board.summary()["seconds"]["filtered"] == pytest.approx({"svm": 0.002, "post": 0.002})


def test_a_frame_that_ignores_every_pixel_has_undefined_rates_and_is_counted_so() -> None:
    board = a_board()
    frame = a_frame(np.full_like(TRUTH, 255))
    board.add(board.score(frame, Role.EVALUATED, (FILTERED,)))
    totals = board.totals()["filtered"]["post"]
    assert totals["N"] == 0
    assert math.isnan(totals["ERR"])
    assert totals["undefined"]["ERR"] == 1


class TestTheSelfCheck:
    names = (("net", "svm"), ("net", "post"))
    whole = (2, 2, 1, 1)

    def check(self, labelled: int, second: Sequence[Counted], found: Sequence[str] = ()) -> None:
        """Prove two masks. Nothing is amiss with the first: its first part is the whole of it."""
        parts = [self.whole, (0, 0, 0, 0)] if found else []
        check_conserved(self.names, np.array([[self.whole, *parts], second]), found, labelled)

    def test_accepts_counts_that_add_up(self) -> None:
        halves = [(1, 0, 1, 0), (1, 2, 0, 1)]
        self.check(6, [self.whole, *halves], ["boundary", "interior"])

    def test_refuses_a_lost_pixel(self) -> None:
        with pytest.raises(CountsNotConservedError, match=r"net/post: .* \(whole\), of 6 labelled"):
            self.check(6, [(2, 2, 1, 0)])

    def test_refuses_a_negative_count(self) -> None:
        with pytest.raises(CountsNotConservedError, match="net/post"):
            self.check(6, [(7, 0, -1, 0)])

    @pytest.mark.parametrize("found", [["band_0", "band_1"], ["boundary", "interior"]])
    def test_refuses_parts_that_do_not_make_the_whole(self, found: list[str]) -> None:
        with pytest.raises(CountsNotConservedError, match="net/post"):
            self.check(6, [self.whole, (2, 0, 0, 0), (0, 2, 2, 0)], found)

    def test_regions_that_overlap_need_not_make_the_whole(self) -> None:
        self.check(6, [self.whole, (2, 0, 0, 0), (0, 2, 2, 0)], ["shadow", "lit"])


class TestOracles:
    variant = replace(FILTERED, oracles={"svm": {"post": Packed.of(pixels("##..", "##.#"))}})

    def test_are_counted_apart_and_named_after_the_stage_that_was_replaced(self) -> None:
        result = a_board().score(a_frame(TRUTH, 4), Role.EVALUATED, (self.variant,))
        assert result.oracles["svm"][0].counts == Counts(tp=4, tn=3)

    def test_are_never_among_the_results(self) -> None:
        frame, own = a_frame(TRUTH), (self.variant, UNFILTERED)
        with_oracles = a_board().score(frame, Role.EVALUATED, own)
        without = a_board().score(frame, Role.EVALUATED, (FILTERED, UNFILTERED))
        assert with_oracles.tallies == without.tallies
        assert without.oracles == {}

    def test_are_summed_up_by_variant_oracle_and_stage(self) -> None:
        board = a_board()
        for number in range(3):
            result = board.score(a_frame(TRUTH, number), Role.EVALUATED, (self.variant,))
            board.add(result)
        assert board.oracles()["filtered"]["svm"]["post"]["TP"] == 12
        assert board.summary()["oracles"]["filtered"]["svm"]["post"]["ERR"] == 0
        assert list(board.totals()["filtered"]) == ["svm", "post"]


def test_changes_and_heat_maps_are_summed_up_over_the_drive() -> None:
    sums = a_drive(3, a_board(BlindPrior.of_truths([TRUTH])))
    assert sums.changes["filtered", "svm", "filtered", "post"] == Change(3, 0, 21)
    assert sums.changes["unfiltered", "post", "filtered", "post"] == Change(0, 3, 21)
    assert sums.changes["filtered", "post", "unfiltered", "post"] == Change(3, 0, 21)
    assert sums.changes["blind", "post", "filtered", "post"] == Change(0, 3, 21)
    side, cells = sums.heat["filtered"].cells()
    assert (side, cells[:, 1, 1].tolist(), cells[:, 1, 3].tolist()) == (1, [3, 0, 3], [0, 0, 0])
    assert sums.heat["unfiltered"].cells()[1][:, 1, 1].tolist() == [3, 0, 0]
