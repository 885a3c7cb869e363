"""The model file: plain data, complete or refused, whatever array is damaged."""

import dataclasses
import json
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from roadeval.config.run import configure
from roadeval.errors import RoadevalError
from roadeval.training.learning import fit, from_file
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


READ_NO_MORE = "in a format that is no longer read: train it again"
LATER = "a later version: update roadeval"


@pytest.mark.parametrize(
    ("version", "writer", "why"),
    [
        (2, None, f"made by roadeval 0.1.0 {READ_NO_MORE}"),
        (6, None, f"made by an earlier version of roadeval {READ_NO_MORE}"),
        (None, None, f"made by an earlier version of roadeval {READ_NO_MORE}"),
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


SMALL = {"preset": "robust", "trees": {"trees": 10, "features": ["place"]}}
"""Boosted trees that learn at once: what takes long is to find bins for many features."""
EXTRA = {"printed": {"preset": "printed"}, "gated": {"preset": "gated"}, "robust": SMALL}
PIPELINES = configure({"variants": EXTRA}).pipelines()


def filled(value):
    """Damage one number of an array."""

    def damage(array):
        is_integer = array.dtype.kind in "iu"  # no integer is any of these
        spoilt = array.astype(np.float64) if is_integer else array.copy()
        with np.errstate(over="ignore"):  # half precision makes infinity of a huge number
            spoilt[(0,) * array.ndim] = value
        return spoilt

    return damage


DAMAGES = {
    "missing": lambda array: None,
    "an axis more": lambda array: array[None],
    "an axis less": lambda array: array[0] if array.ndim else array.repeat(2),
    "empty": lambda array: array[:0] if array.ndim else np.zeros(0),
    "a column less": lambda array: array[..., :-1] if array.ndim else array.repeat(0),
    "not a number": filled(np.nan),
    "without end": filled(-np.inf),
    "huge": filled(1e30),
    "text": lambda array: array.astype("U"),
    "complex": lambda array: array.astype(complex),
}

HARMLESS = {("huge", "threshold"), ("missing", "prior"), ("a column less", "prior")}
"""A threshold may be of any size, and a prior too, or there is none."""
NEIGHBOURS = {"lowest": "scale"}
"""The array that an error names in place of another: its length decides that of the other."""


@pytest.fixture(scope="module")
def arrays(tmp_path_factory):
    """The arrays of a sound model file of every stage that learns."""
    path = tmp_path_factory.mktemp("sound") / "city.model"
    prior = np.linspace(0, 1, 24 * 32, dtype=np.float32).reshape(24, 32)
    settings = TrainingSettings()
    model = fit([frame(n) for n in range(3)], PIPELINES, settings)
    save_model(replace(model, prior=prior), path)
    from_file(path, PIPELINES)
    with np.load(path) as archive:
        return dict(archive)


def refusal(arrays, folder: Path) -> str:
    """Write a model file and give the sentence that refuses it."""
    path = folder / "x.model"
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(RoadevalError) as caught:
        from_file(path, PIPELINES)
    sentence = str(caught.value)
    assert sentence.startswith(f"{path}: ")
    assert "\n" not in sentence
    return sentence


@pytest.mark.parametrize("damage", DAMAGES)
def test_no_damaged_array_is_accepted(arrays, tmp_path, damage):
    one_of_each_stage = {name.partition("/")[2] or name: name for name in arrays}
    for name in one_of_each_stage.values():
        array, field = arrays[name], name.rpartition("/")[-1]
        if field == "header" or (damage, field) in HARMLESS:
            continue
        spoilt = DAMAGES[damage](array)
        rest = {other: arrays[other] for other in arrays if other != name}
        message = refusal(rest if spoilt is None else {**rest, name: spoilt}, tmp_path)
        assert field in message or NEIGHBOURS.get(field, field) in message


@pytest.mark.parametrize(
    ("name", "damage", "why"),
    [
        ("filtered/similarity/covariance", np.negative, "positive semi-definite"),
        ("filtered/similarity/covariance", np.tril, "not symmetric"),
        ("gated/gated/place", lambda a: a + 1, "place holds a number outside 0 to 1"),
        ("filtered/svm/scale", np.zeros_like, "scale holds a number outside"),
        ("filtered/svm/mean", np.negative, "mean holds a number outside 0 to 255"),
        ("filtered/svm/vectors", lambda a: a[1:], r"weights has the shape .* instead of \(m,\)"),
        ("robust/trees/forest/values", lambda a: a.astype(np.float64), "instead of float32"),
        ("robust/trees/forest/feature", np.negative, "feature holds a number outside 0 to"),
        ("robust/trees/forest/kept", np.zeros_like, "rules out a tree's last leaf"),
        ("prior", lambda a: a + 0.5, "prior holds a number outside 0 to 1"),
        ("prior", lambda a: a * 255 > 0, "prior is of type bool"),
    ],
)
def test_the_sentence_says_what_is_wrong(arrays, tmp_path, name, damage, why):
    sentence = refusal({**arrays, name: damage(arrays[name])}, tmp_path)
    assert re.search(why, sentence)


@pytest.mark.parametrize(
    "stage", ["filtered/similarity", "filtered/svm", "gated/gated", "robust/trees"]
)
def test_a_stage_that_learnt_nothing_is_refused(arrays, tmp_path, stage):
    rest = {name: array for name, array in arrays.items() if not name.startswith(stage)}
    variant, name = stage.split("/")
    assert f"{name} of variant {variant} has learnt nothing" in refusal(rest, tmp_path)


@pytest.mark.parametrize("name", ["night/svm/mean", "filtered/post/mean", "filtered/x/y", "x", "/"])
def test_an_array_that_belongs_nowhere_is_refused(arrays, tmp_path, name):
    assert name.rpartition("/")[0] in refusal({**arrays, name: np.zeros(3)}, tmp_path)


@pytest.mark.parametrize(
    "wrong",
    [
        *({key: None} for key in ("settings", "source", "digests", "pixels", "warnings")),
        {"settings": {"filtered": ["svm"]}},
        {"source": "guess"},
        {"digests": [1, 2]},
        {"pixels": -1},
        {"warnings": "none"},
        {"format": ["roadeval-model"]},
    ],
)
def test_a_damaged_header_is_refused(arrays, tmp_path, wrong):
    header = json.loads(arrays["header"].tobytes()) | wrong
    assert "model file" in refusal({**arrays, "header": as_bytes(json.dumps(header))}, tmp_path)


@pytest.mark.parametrize("text", ["[]", "1", "{", "[" * 100_000, "\udcff"])
def test_a_header_that_is_none_is_refused(arrays, tmp_path, text):
    header = as_bytes(text)
    assert "not a model file" in refusal({**arrays, "header": header}, tmp_path)


def as_bytes(text: str):
    return np.frombuffer(text.encode(errors="surrogateescape"), np.uint8)
