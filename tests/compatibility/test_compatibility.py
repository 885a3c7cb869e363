"""What every earlier version left is read, with the numbers it had, or refused with the way out."""

import json
from functools import cache
from unittest import mock

import pytest

from roadeval import Recording, compare, configure, load_config
from roadeval.config import ConfigError
from roadeval.jobs.inspect import worst_frames
from roadeval.jobs.report_findings import collect
from roadeval.jobs.result import Result
from roadeval.recording import checks
from roadeval.training.learning import from_file
from tests.compatibility.make import MODEL, RECORDING, RESULTS, unpack, versions

WITHOUT_CONFIGURATION = {"0.1.0"}
"""Versions that wrote no ``run.toml``."""
EVALUATED = {3, 4, 5, 6, 7}
PICTURES = {
    **dict.fromkeys(("ndi", "distance"), "float32"),
    **dict.fromkeys(("shadow", "rings", "similarity", "svm", "post", "boundary"), "uint8"),
    "compensated": "uint8",
}


@pytest.fixture(scope="module", autouse=True)
def _tried_once():
    """Try a recording without checksums in another process once, and not whenever it is opened."""
    with mock.patch.object(checks, "can_be_read", cache(checks.can_be_read)):
        yield


@pytest.fixture(scope="module", params=versions())
def made(request, tmp_path_factory):
    return request.param, unpack(request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(params=[RECORDING, RESULTS])
def result(made, request):
    return made[1] / request.param


def test_no_version_is_dropped():
    assert {"0.1.0", "0.2.0"} <= set(versions())


def test_its_numbers_are_those_that_it_wrote(made, result):
    frames = Result(result).frames
    written = json.loads((made[1] / RESULTS / "summary.json").read_text())
    assert set(frames["frame"]) == EVALUATED
    for variant, stages in written["totals"].items():
        for stage, rates in stages.items():
            rows = frames[(frames["variant"] == variant) & (frames["stage"] == stage)]
            assert rows["ERR"].mean() == pytest.approx(rates["ERR"], rel=1e-12)


def test_all_that_a_report_needs_is_in_it(result):
    found = collect(Result(result))
    assert found.complete
    assert set(found.finals) == {"filtered", "unfiltered", "blind"}
    assert all(len(each) for each in (found.windows, found.changes, found.oracles))


def test_it_is_compared(made):
    both = compare([made[1] / RECORDING, made[1] / RESULTS])
    assert both.comparison.same_drive
    changed = [
        difference for each in both.comparison.changes for difference in each.difference.values()
    ]
    assert changed
    assert not any(each.mean for each in changed)


def test_its_worst_frames_are_listed(result):
    assert [found.rank for found in worst_frames(Result(result), 2)] == [1, 2]


def test_its_pictures_are_decoded(made):
    recording = Recording(made[1] / RECORDING)
    (frame,) = Result(made[1] / RECORDING).pictured
    assert recording.image(frame).shape == (48, 64, 3)
    assert set(recording.truth(frame).ravel()) <= {0, 1, 255}
    for spec in recording.variants[0].layers:
        assert recording.layer("filtered", spec.name, frame).dtype == PICTURES[spec.name]


def test_its_model_is_used(made):
    model, _ = from_file(made[1] / MODEL, configure({}).pipelines())
    assert model.source == "truth"


def test_its_configuration_makes_the_run_again_or_the_way_is_told(made):
    version, folder = made
    for path in (folder / RECORDING, folder / RESULTS / "run.toml"):
        if version in WITHOUT_CONFIGURATION:
            with pytest.raises(ConfigError, match=r"replay the drive|there is no such"):
                load_config(path)
        else:
            assert load_config(path).training.frames == 3
