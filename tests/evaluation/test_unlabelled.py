"""What is known of frames without truth: entropy, disagreement, flicker; and the rank by them."""

import numpy as np
import pytest
from scipy import stats

from roadeval.data import Output, Packed, Role, StageResult, VariantResult
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.score.unlabelled import (
    Unlabelled,
    choose_frames,
    doubts_of,
    entropy,
    sign_of,
)
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, pixels


def variant(name, mask, codes=None):
    output = Output(mask=Packed.of(mask), probability=codes)
    return VariantResult(name, (StageResult("post", output, 0.0),))


def a_board(*names):
    return Scoreboard(("street", "/camera"), EvaluationSettings(), names, None)


def seen(board, number, *variants, truth=None):
    """Score and add a frame; return its doubts."""
    frame = a_frame(truth, number=number)
    role = Role.UNLABELLED if truth is None else Role.EVALUATED
    return board.add(board.score(frame, role, variants))


def test_entropy_is_scipy_s_on_every_fourth_pixel():
    codes = np.random.default_rng(0).integers(0, 65536, (64, 96)).astype(np.uint16)
    p = codes[::4, ::4].ravel() / 65535
    assert entropy(codes) == pytest.approx(stats.entropy([p, 1 - p], base=2).mean(), abs=1e-6)


def test_disagreement_is_the_mean_share_of_differing_pixels_over_the_others():
    a, b, c = pixels("##.."), pixels("#..."), pixels("....")
    first, second, third = doubts_of([variant("a", a), variant("b", b), variant("c", c)])
    assert first.differs == {"b": 0.25, "c": 0.5}
    assert [e.disagreement for e in (first, second, third)] == [0.375, 0.25, 0.375]
    assert np.isnan([first.entropy, doubts_of([variant("a", a)])[0].disagreement]).all()


def test_flicker_counts_pixels_that_change_and_begins_anew_after_a_gap():
    board = a_board("a")
    flicker = [
        seen(board, 0, variant("a", pixels("##.."))),
        seen(board, 1, variant("a", pixels("#.#."))),
    ]
    board.lose()
    flicker += [seen(board, 3, variant("a", pixels("....")))]
    seen(board, 4, variant("a", pixels("....")), truth=pixels("...."))
    flicker += [seen(board, 5, variant("a", pixels("####")))]
    found = [own[0].flicker for own in flicker]
    assert found == pytest.approx([np.nan, 0.5, np.nan, np.nan], nan_ok=True)


def test_frames_with_truth_and_training_frames_have_no_doubt():
    board = a_board("a")
    assert seen(board, 0, variant("a", pixels("#...")), truth=pixels("#...")) == ()
    found = board.score(a_frame(None, number=1), Role.TRAINING, (variant("a", pixels("#...")),))
    assert found.doubts == ()


def test_a_variant_is_ranked_by_the_first_sign_that_it_has():
    found = {}
    for names in (("sure", "plain"), ("plain", "sure")):
        board, codes = a_board(*names), {"sure": np.full((1, 4), 20000, np.uint16)}
        for number in range(2):
            masks = {"sure": pixels("#..."), "plain": pixels("....")}
            seen(board, number, *(variant(name, masks[name], codes.get(name)) for name in names))
        found[names[0]] = sign_of(board.unlabelled.rows())
    assert found == {"sure": "entropy", "plain": "disagreement"}
    assert sign_of(Unlabelled().rows()) is None


def test_where_there_is_no_room_for_the_whole_distance_it_is_halved_and_not_given_up():
    stamps = np.arange(900) * 10**9 // 30
    random, ranked = choose_frames(stamps, np.linspace(1, 2, 900), 60, seed=0)
    assert len(random) == len(ranked) == 30
    places = np.sort(np.concatenate([random, ranked]))
    beside = np.minimum(np.diff(places, prepend=-900), np.diff(places, append=1800))
    assert beside[np.isin(places, ranked)].min() >= 7  # a quarter of the 30 frames of a second
