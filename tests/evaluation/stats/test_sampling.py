"""Rates of a drive from frames drawn at random: the order of drawing, and the interval."""

from itertools import pairwise

import numpy as np
import pytest
import statsmodels.api as sm
from scipy import signal, stats

from roadeval.evaluation.stats.sampling import REGRESSION_FROM, draw_order, estimate


@pytest.mark.parametrize("count", [1, 2, 7, 64, 1000])
def test_an_order_has_every_frame_once_and_a_seed_repeats_it(count):
    assert sorted(draw_order(count, 3)) == list(range(count))
    np.testing.assert_array_equal(draw_order(count, 3), draw_order(count, 3))


@pytest.mark.parametrize(("count", "first"), [(7, 3), (91, 10)])
def test_every_frame_is_as_likely_to_be_drawn(count, first):
    draws = 2000
    seen = np.bincount(
        np.concatenate([draw_order(count, seed)[:first] for seed in range(draws)]), minlength=count
    )
    variance = draws * first / count * (1 - first / count)
    # Exactly `first` are drawn each time, which leaves count - 1 degrees of freedom.
    chi2 = ((seen - draws * first / count) ** 2).sum() / variance * (count - 1) / count
    assert 1e-3 < stats.chi2.sf(chi2, count - 1) < 1 - 1e-3


def test_every_beginning_is_spread_along_the_drive():
    for seed in range(20):
        for parts in (4, 8, 16):
            drawn = np.sort(draw_order(160, seed)[:parts])
            gaps = np.diff([*drawn, drawn[0] + 160])
            assert gaps.max() < 2 * 160 / parts + 1


def a_drive(seed, frames=91, slope=1.0):
    """Scores, and skewed rates that go with them."""
    rng = np.random.default_rng(seed)
    scores = rng.gamma(4, 0.01, frames)
    return scores, slope * scores + rng.gamma(1.5, 0.01, frames)


def judged(rates, scores, mean_score, frames):
    """The mean by statsmodels, and its error of HC3 and of neighbours among the labels."""
    fit = sm.OLS(rates, sm.add_constant(scores)).fit(cov_type="HC3")
    at = np.array([1, mean_score])
    simple, share = at @ fit.cov_params() @ at, len(rates) / frames
    hat = fit.get_influence().hat_matrix_diag
    parts = fit.model.exog @ fit.normalized_cov_params @ at * fit.resid / (1 - hat)
    pairs = [(one - other) ** 2 / 2 for one, other in pairwise(parts)]
    along = np.mean(pairs) * len(rates)
    return float(fit.predict(at[None])[0]), np.sqrt((1 - share) * (along + share * simple))


@pytest.mark.parametrize("labels", [REGRESSION_FROM, 25])
def test_mean_and_error_are_those_of_statsmodels(labels):
    scores, rates = a_drive(0)
    drawn = np.sort(draw_order(91, 1)[:labels])
    found = estimate(rates[drawn], scores[drawn], scores)
    mean, error = judged(rates[drawn], scores[drawn], scores.mean(), 91)
    assert found.mean == pytest.approx(mean)
    reach = stats.t.ppf(0.975, labels - 2) * error / mean
    assert found.low == pytest.approx(mean * np.exp(-reach))
    assert found.high == pytest.approx(mean * np.exp(reach))


def test_neighbours_that_are_alike_narrow_the_interval_which_still_holds():
    held, widths, simple_widths = 0, [], []
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(size=2000)
        level = signal.lfilter([0.05], [1, -0.995], noise)
        rates, unknown = 0.03 * np.exp(level - level.mean()), np.full(2000, np.nan)
        drawn = np.sort(draw_order(2000, seed)[:20])
        found = estimate(rates[drawn], unknown[drawn], unknown)
        held += found.low <= rates.mean() <= found.high
        widths.append(found.high - found.low)
        error = rates[drawn].std(ddof=1) / np.sqrt(20)
        simple_widths.append(2 * stats.t.ppf(0.975, 19) * error)
    assert held >= 93
    assert np.median(widths) < 0.8 * np.median(simple_widths)


def test_few_labels_or_an_unknown_score_give_the_plain_mean():
    scores, rates = a_drive(0)
    few, many = draw_order(91, 1)[: REGRESSION_FROM - 1], draw_order(91, 1)[:20]
    assert estimate(rates[few], scores[few], scores).mean == pytest.approx(rates[few].mean())
    unknown = np.where(np.arange(91) == 4, np.nan, scores)
    assert estimate(rates[many], unknown[many], unknown).mean == pytest.approx(rates[many].mean())


@pytest.mark.parametrize("labels", [5, 10, 25])
def test_the_interval_holds(labels):
    held = 0
    for seed in range(300):
        scores, rates = a_drive(seed)
        drawn = np.sort(draw_order(91, seed)[:labels])
        found = estimate(rates[drawn], scores[drawn], scores)
        held += found.low <= rates.mean() <= found.high
    assert held >= 0.93 * 300


def bursts(seed, doubt, count, length):
    """Scores and rates of 600 frames with few errors, but for some bursts of much higher ones.

    On these the score is raised by ``doubt``, about as far above the usual one of 0.03.
    """
    rng = np.random.default_rng(seed)
    scores = 0.03 * np.exp(0.25 * rng.standard_normal(600))
    rates = 0.003 * np.exp(0.5 * rng.standard_normal(600))
    for first in length * rng.choice(600 // length, count, replace=False):
        scores[first : first + length] += doubt * np.exp(0.3 * rng.standard_normal(length))
        rates[first : first + length] = 0.3 * np.exp(0.2 * rng.standard_normal(length))
    return scores, rates


@pytest.mark.parametrize(("labels", "doubt"), [(10, 0.03), (20, 0.1)])
@pytest.mark.parametrize(("count", "length"), [(3, 6), (1, 20), (8, 3)])
def test_rare_bursts_that_the_scores_tell_of_are_within_the_interval(labels, doubt, count, length):
    """Without scores the interval holds in 20 to 60 % of the draws, whatever its confidence."""
    held = np.zeros(2, int)
    for seed in range(60):
        scores, rates = bursts(seed, doubt, count, length)
        drawn = np.sort(draw_order(600, seed)[:labels])
        for place, known in enumerate((scores, np.full(600, np.nan))):
            found = estimate(rates[drawn], known[drawn], known)
            held[place] += found.low <= rates.mean() <= found.high
    assert held[0] >= 54
    assert held[1] <= 42


def test_frames_far_more_in_doubt_than_all_that_were_drawn_may_have_any_rate():
    scores, rates = np.array([1.0, 2.0, 3.0, 2.0] * 4 + [50.0] * 2), np.array([0.1, 0.2, 0.1, 0.2])
    plain = estimate(rates, scores[:4], np.minimum(scores, 3))
    found = estimate(rates, scores[:4], scores)
    assert (found.unseen, plain.unseen) == (2, 0)
    assert found.low == pytest.approx(plain.low * 16 / 18)
    assert found.high == pytest.approx(plain.high * 16 / 18 + 2 / 18)
    assert estimate(rates, scores[[0, 1, 2, 16]], scores).unseen == 0


def test_a_score_that_goes_with_the_rate_narrows_the_interval():
    def width(slope):
        scores, rates = a_drive(5, slope=slope)
        drawn = np.sort(draw_order(91, 5)[:20])
        found = estimate(rates[drawn], scores[drawn], scores)
        plain = estimate(rates[drawn], scores[drawn], np.full(91, np.nan))
        return (found.high - found.low) / (plain.high - plain.low)

    assert width(4.0) < 0.6


def test_all_frames_labelled_leave_no_doubt():
    scores, rates = a_drive(0)
    found = estimate(rates, scores, scores)
    assert (found.low, found.mean, found.high) == pytest.approx([rates.mean()] * 3)
    assert found.to_halve is None


def test_one_label_or_labels_without_a_difference_give_no_interval():
    assert estimate(np.array([0.1]), np.array([1.0]), np.arange(9.0)).low is None
    assert estimate(np.zeros(5), np.arange(5.0), np.arange(9.0)).high is None


def test_so_many_more_would_halve_the_interval():
    scores, rates = a_drive(2, frames=2000)
    order = draw_order(2000, 2)
    found = estimate(rates[order[:12]], scores[order[:12]], scores)

    def width(labels):
        return stats.t.ppf(0.975, labels - 2) * np.sqrt(1 / labels - 1 / 2000)

    more = found.to_halve
    assert width(12 + more) <= width(12) / 2 < width(12 + more - 1)
