"""The model file: plain data, complete or refused."""

import dataclasses
import json
import tracemalloc
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from roadeval.config.run import configure
from roadeval.errors import RoadevalError
from roadeval.training.learning import fit
from roadeval.training.model import Model, load_model, save_model
from roadeval.training.settings import TrainingSettings
from tests.training.making import frame, pipelines

FEW = {"trees": {"trees": 10, "features": ["place"]}}
"""Boosted trees that learn at once."""


@pytest.fixture(scope="module")
def model() -> Model:
    prior = np.linspace(0, 1, 24 * 32, dtype=np.float32).reshape(24, 32)
    fitted = fit([frame(n) for n in range(3)], pipelines(), TrainingSettings())
    return dataclasses.replace(fitted, prior=prior)


@pytest.fixture
def path(model: Model, tmp_path: Path) -> Path:
    save_model(model, tmp_path / "city.model")
    return tmp_path / "city.model"


def test_a_model_reads_back_equal(model, path):
    read = load_model(path)
    assert read.digests == model.digests
    assert read.source == model.source
    np.testing.assert_array_equal(read.prior, model.prior)
    for variant, stages in model.parameters.items():
        for stage, parameters in stages.items():
            for entry in dataclasses.fields(parameters):
                np.testing.assert_array_equal(
                    getattr(read.parameters[variant][stage], entry.name),
                    getattr(parameters, entry.name),
                )


def test_the_same_model_gives_the_same_bytes(model, path, tmp_path):
    save_model(model, tmp_path / "again.model")
    assert (tmp_path / "again.model").read_bytes() == path.read_bytes()


def test_other_settings_are_refused_by_name(path):
    pipeline = configure({"svm": {"gamma": 2.0}}).pipeline
    with pytest.raises(RoadevalError, match=r"settings of svm .*gamma 0.5 there, 2.0 here"):
        load_model(path).require("filtered", pipeline, path)


@pytest.mark.parametrize(
    ("name", "stage", "setting"),
    [
        ("paper", "svm", {"threshold": 0.3}),
        ("paper", "similarity", {"quantile": 0.5}),
        ("robust", "trees", {"threshold": 0.3}),
    ],
)
def test_settings_that_decide_and_teach_nothing_may_differ(tmp_path, name, stage, setting):
    pipeline = configure({"preset": name, **(FEW if stage == "trees" else {})}).pipeline
    save_model(fit([frame(0)], {"x": pipeline}, TrainingSettings()), tmp_path / "x.model")
    settings = {
        **pipeline.settings,
        stage: dataclasses.replace(pipeline.settings[stage], **setting),
    }
    other = dataclasses.replace(pipeline, settings=settings)
    load_model(tmp_path / "x.model").require("x", other, tmp_path / "x.model")


def test_a_variant_it_was_not_trained_for_is_refused(path):
    with pytest.raises(RoadevalError, match=r"no variant night .it has filtered, unfiltered"):
        load_model(path).require("night", pipelines()["filtered"], path)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 no archive", b"\x80\x04}."])
def test_another_file_is_refused(tmp_path, content):
    path = tmp_path / "x.model"
    path.write_bytes(content)
    with pytest.raises(RoadevalError, match="not a model file"):
        load_model(path)


def test_an_array_that_hides_code_is_not_run(tmp_path):
    class Trap:
        def __reduce__(self):
            return (exec, ("raise SystemExit('ran')",))

    path = tmp_path / "trap.model"
    with path.open("wb") as file:
        np.savez(file, header=np.array([Trap()], object))
    with pytest.raises(RoadevalError, match="not a model file"):
        load_model(path)


READ_NO_MORE = "whose format is no longer read: train it again"
LATER = "a later version: update roadeval"


@pytest.mark.parametrize(
    ("version", "writer", "why"),
    [
        (2, None, f"made by roadeval 0.1.0, {READ_NO_MORE}"),
        (6, None, f"made by an earlier version of roadeval, {READ_NO_MORE}"),
        (None, None, f"made by an earlier version of roadeval, {READ_NO_MORE}"),
        (99, "9.0", f"made by roadeval 9.0, {LATER}"),
    ],
)
def test_another_format_is_refused_in_one_line_that_says_who_wrote_it(path, version, writer, why):
    changed(path, {"version": version, "roadeval": writer})
    with pytest.raises(RoadevalError) as caught:
        load_model(path)
    assert str(caught.value) == f"{path}: {why}"


def changed(path, values, *, without=""):
    """Change values of a model file's header, and leave out an array."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name != without}
    header = json.loads(arrays["header"].tobytes()) | values
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez(file, **arrays)


# --- What a stage has learnt as named arrays, and back --------------------------------------------


def test_an_archive_that_unpacks_to_more_than_any_model_is_not_unpacked(path, monkeypatch):
    monkeypatch.setattr("roadeval.training.model.GREATEST_SIZE", 64 << 20)
    with ZipFile(path, "a", ZIP_DEFLATED) as archive, archive.open("more.npy", "w") as file:
        for _ in range(64):
            file.write(bytes(1 << 20))
    tracemalloc.start()
    try:
        with pytest.raises(RoadevalError, match="not a model file, or a damaged one"):
            load_model(path)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()
