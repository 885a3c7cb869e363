"""Model files that hold what no training gives: refused in one line, whatever array is damaged."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from roadeval.config.run import configure
from roadeval.errors import RoadevalError
from roadeval.training.learning import fit, from_file
from roadeval.training.model import save_model
from roadeval.training.settings import TrainingSettings
from tests.training.making import frame

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
    for name, array in arrays.items():
        field = name.rpartition("/")[-1]
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
