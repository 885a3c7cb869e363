"""Fitting the variants."""

import numpy as np
import pytest

from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import View
from roadeval.training import TrainingError, TrainingSettings, fit
from tests.training.making import frame, pipelines

FRAMES = [frame(n) for n in range(3)]


def test_a_fitted_variant_finds_the_road_in_a_new_frame():
    pipeline = pipelines()["unfiltered"]
    model = fit(FRAMES, {"unfiltered": pipeline}, TrainingSettings())
    chain = pipeline.bind(model.parameters["unfiltered"])
    fresh = frame(9)
    masks = {name: output.mask.pixels() for name, output in chain.run(View.of(fresh.image))}
    for name in ("similarity", "svm", "post"):
        wrong = (masks[name] != fresh.truth).mean()
        assert wrong < 0.06, name


def test_each_variant_learns_from_its_own_images():
    model = fit(FRAMES, pipelines(), TrainingSettings())
    filtered, unfiltered = model.parameters["filtered"], model.parameters["unfiltered"]
    # The filter takes the verge for shadow: only the unfiltered machine ever saw green.
    assert filtered["svm"].mean[1] != unfiltered["svm"].mean[1]


def test_road_colour_is_the_mean_of_the_sampled_road_pixels():
    model = fit(FRAMES, pipelines(), TrainingSettings(pixels_per_class=10_000))
    road = np.concatenate([f.image[f.truth == 1] for f in FRAMES]).astype(float)
    colour = model.parameters["unfiltered"]["similarity"]
    # Every road pixel is drawn: there are as many as of the verge.
    np.testing.assert_allclose(colour.mean, road.mean(axis=0))
    np.testing.assert_allclose(colour.covariance, np.cov(road.T, ddof=0))


def test_training_twice_gives_the_same_model():
    first, second = (fit(FRAMES, pipelines(), TrainingSettings()) for _ in range(2))
    machines = [m.parameters["filtered"]["svm"] for m in (first, second)]
    np.testing.assert_array_equal(machines[0].vectors, machines[1].vectors)
    np.testing.assert_array_equal(machines[0].weights, machines[1].weights)


def test_the_model_remembers_its_frames():
    model = fit(FRAMES, pipelines(), TrainingSettings())
    assert model.digests == {f.digest() for f in FRAMES}
    assert frame(9).digest() not in model.digests


def test_no_frames_are_an_error():
    with pytest.raises(TrainingError, match="no frame to train on"):
        fit([], pipelines(), TrainingSettings())


def test_one_class_alone_is_an_error_that_names_the_frames():
    sky = frame(4)
    sky.truth[:] = 0
    with pytest.raises(TrainingError, match="frames 4 to 4 do not show both road and non-"):
        fit([sky], pipelines(), TrainingSettings())


def test_insisting_on_truth_where_there_is_none_is_an_error():
    with pytest.raises(TrainingError, match="no truth to train on"):
        fit([frame(labelled=False)], pipelines(), TrainingSettings(source="truth"))


def test_without_truth_the_patch_teaches():
    unlabelled = [frame(n, labelled=False) for n in range(3)]
    model = fit(unlabelled, pipelines(), TrainingSettings())
    assert model.source == "patch"
    assert model.prior is None


def test_a_collapsed_classifier_is_reported():
    # A threshold that no decision value reaches: nothing is ever called road.
    settings = dict(pipelines()["unfiltered"].settings)
    settings["svm"] = type(settings["svm"])(threshold=1000.0)
    pipeline = Pipeline(("similarity", "svm", "post"), settings)
    warnings = fit(FRAMES, {"x": pipeline}, TrainingSettings()).warnings
    assert any("x: svm has collapsed: it calls 0.0% of its own" in w for w in warnings)


def test_a_sound_classifier_is_not_reported():
    only = {"unfiltered": pipelines()["unfiltered"]}
    assert fit(FRAMES, only, TrainingSettings()).warnings == ()
