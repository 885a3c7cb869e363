"""Eq. 12-16 against scikit-learn, and the table of all colours against the definition."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from roadeval.kernels import KERNELS
from roadeval.pipeline.colour_table import FEW, table_of
from roadeval.pipeline.paper import svm
from roadeval.pipeline.paper.svm import SvmSettings
from roadeval.pipeline.stage import TrainingSet, View
from tests.pipeline.images import noise

ROUNDING = 1e-9
"""A decision value this near the threshold may fall to either side."""

SETTINGS = {
    "paper": SvmSettings(),
    "printed": SvmSettings(kernel="linear"),
    "narrow": SvmSettings(gamma=20.0, c=10.0),
    "narrower than a level": SvmSettings(gamma=2000.0),
    "another threshold": SvmSettings(threshold=0.3),
}


def sample(n=80, seed=0):
    """Grey road between dark and bright, and other colours: not separable."""
    rng = np.random.default_rng(seed)
    road = rng.normal(110, 20, (n, 1)) + rng.normal(0, 6, (n, 3))
    other = np.where(
        rng.random((n, 1)) < 0.5, rng.normal(40, 25, (n, 3)), rng.normal(190, 40, (n, 3))
    )
    colours = np.clip(np.concatenate([road, other]), 0, 255).astype(np.uint8)
    where = np.zeros(2 * n, np.intp)
    return TrainingSet((colours[None],), where, where, np.arange(2 * n), np.arange(2 * n) < n)


def scikit_learns(settings, training):
    machine = SVC(C=settings.c, kernel=settings.kernel, gamma=settings.gamma)
    return make_pipeline(StandardScaler(), machine).fit(training.colours(), training.road)


@pytest.fixture(scope="module", params=SETTINGS.values(), ids=SETTINGS)
def case(request):
    """Settings, the machine that was fitted, its stage, and scikit-learn's own."""
    settings, training = request.param, sample()
    machine = svm.fit(training, settings)
    return settings, machine, svm.bind(settings, machine), scikit_learns(settings, training)


def road(stage, colours):
    """Return the mask of ``(n, 3)`` colours, as an image of one row."""
    return stage(View.of(colours[None])).mask.pixels()[0]


COLOURS = np.concatenate([noise(1, 8000)[0], sample().colours(), sample(seed=1).colours()])


def test_decision_values_equal_scikit_learns(case):
    settings, machine, _, theirs = case
    ours = svm.decision(COLOURS, machine, settings)
    np.testing.assert_allclose(ours, theirs.decision_function(COLOURS), rtol=0, atol=ROUNDING)


def test_the_mask_equals_predict_on_every_pixel_that_is_not_on_the_threshold(case):
    settings, _, stage, theirs = case
    values = theirs.decision_function(COLOURS)
    clear = np.abs(values - settings.threshold) > ROUNDING
    assert clear.mean() > 0.99
    expected = values > settings.threshold if settings.threshold else theirs.predict(COLOURS)
    np.testing.assert_array_equal(road(stage, COLOURS)[clear], expected[clear])


def test_nothing_is_printed(capfd):
    svm.fit(sample(), SvmSettings())
    ctypes.CDLL(None).fflush(None)  # a library in C keeps its lines back
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kernel", ["rbf", "linear"])
def test_the_greatest_penalty_that_is_allowed_breaks_no_bound_of_what_is_learnt(kernel):
    training = sample(10)
    contradiction = replace(training, road=np.arange(20) % 2 == 0)
    settings = SvmSettings(kernel=kernel, c=1e6)
    assert np.abs(svm.fit(contradiction, settings).weights).max() <= 1e6


def test_a_penalty_beyond_is_refused():
    with pytest.raises(ValueError, match="less than or equal to 1000000"):
        SvmSettings(c=1e16)


@pytest.mark.parametrize("red", [0, 110, 255])
def test_the_mask_equals_the_definition_next_to_the_threshold(case, red):
    settings, machine, stage, _ = case
    margins, error = svm.colour_margins(machine, settings)
    assert error < 1e-5  # or the bound would decide nothing
    quick = margins(red).ravel()
    near = np.argsort(np.abs(quick))[:1000]
    colours = np.stack([np.full(1000, red), near // 256, near % 256], axis=1).astype(np.uint8)
    exact = svm.decision(colours, machine, settings) - settings.threshold
    assert np.abs(quick[near] - exact).max() <= error
    clear = np.abs(exact) > ROUNDING
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(road(stage, colours)[clear], exact[clear] > 0)


@pytest.mark.parametrize("kernel", ["rbf", "linear"])
@pytest.mark.parametrize("colour", [(110, 108, 113), (30, 200, 4)])
def test_a_colour_on_the_threshold_is_decided_by_the_definition(kernel, colour):
    # The threshold is put so near that the quick value, whatever it is, cannot tell the side.
    settings = SvmSettings(kernel=kernel)
    machine = svm.fit(sample(40), settings)
    pixel = np.array([colour], np.uint8)
    value = svm.decision(pixel, machine, settings).item()
    for offset, expected in ((-1e-13, 1), (1e-13, 0)):
        stage = svm.bind(replace(settings, threshold=value + offset), machine)
        assert road(stage, pixel).item() == expected


def indifferent():
    """A machine whose value is 0, the threshold, at every colour."""
    return svm.SupportVectors(
        np.zeros(3), np.ones(3), np.full((2, 3), 100.0), np.array([1.0, -1.0]), 0.0
    )


def test_a_machine_that_learnt_nothing_calls_nothing_road():
    assert not road(svm.bind(SvmSettings(), indifferent()), noise(1, 50)[0]).any()


def test_a_colour_is_decided_alike_whatever_is_decided_with_it(case):
    settings, machine, *_ = case
    together = svm.decision(COLOURS[:500], machine, settings)
    alone = [svm.decision(COLOURS[i : i + 1], machine, settings).item() for i in range(500)]
    assert together.tolist() == alone


def test_the_machine_is_scikit_learns(case):
    settings, machine, _, theirs = case
    svc = theirs[-1]
    np.testing.assert_array_equal(machine.vectors, svc.support_vectors_)
    np.testing.assert_array_equal(machine.weights, svc.dual_coef_[0])
    assert machine.offset == svc.intercept_[0]
    # Eq. 14: 0 <= lambda <= C, and the sum of lambda y is 0.
    assert np.abs(machine.weights).max() <= settings.c
    assert machine.weights.sum() == pytest.approx(0, abs=1e-6)


def test_a_channel_that_never_varies_does_not_divide_by_zero():
    training = sample()
    training.images[0][..., 2] = 77
    machine = svm.fit(training, SvmSettings())
    assert machine.scale[2] == 1
    assert np.isfinite(svm.decision(COLOURS, machine, SvmSettings())).all()


def test_a_linear_machine_cannot_cut_a_mid_grey_out_and_an_rbf_machine_can():
    training = sample()
    accuracy = {}
    for kernel in ("linear", "rbf"):
        settings = SvmSettings(kernel=kernel)
        values = svm.decision(training.colours(), svm.fit(training, settings), settings)
        accuracy[kernel] = ((values > 0) == training.road).mean()
    assert accuracy["linear"] < 0.8
    assert accuracy["rbf"] > 0.9


GREEN, BLUE = np.indices((256, 256))


def margin(red):
    """Positive inside a ball around a colour, and nowhere 0."""
    away = (red - 90) ** 2 + (GREEN - 140.0) ** 2 + (BLUE - 120.0) ** 2
    return 60.0**2 - 0.5 - away


def decide(colours):
    r, g, b = colours.T.astype(np.int64)
    return (r - 90) ** 2 + (g - 140) ** 2 + (b - 120) ** 2 < 60**2


def planes(colours):
    """``(n, 3)`` colours as an image of one row."""
    return tuple(np.ascontiguousarray(colours[None, :, c]) for c in range(3))


def every_colour(red):
    g, b = np.indices((256, 256), np.uint8).reshape(2, -1)
    return np.stack([np.full_like(g, red), g, b], axis=1)


def test_every_colour_is_decided_as_by_the_definition():
    counts = []
    table = table_of((margin, 20.0), lambda c: counts.append(len(c)) or decide(c))
    for red in (0, 29, 30, 31, 90, 147, 150, 255):
        colours = every_colour(red)
        np.testing.assert_array_equal(
            KERNELS.look_up_colours(planes(colours), table)[0], decide(colours)
        )
    assert 0 < sum(counts) < FEW
