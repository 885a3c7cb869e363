"""Which frames train, which are left out, which are evaluated; and the fitting of variants."""

import dataclasses
import json
import re
import tracemalloc
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from roadeval import Model, RoadevalError, configure, load_model, save_model
from roadeval.data import NON_ROAD, ROAD, Frame, Role
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import View
from roadeval.training import learning
from roadeval.training.learning import (
    WIDTH,
    Schedule,
    TrainingError,
    fit,
    from_drives,
    from_file,
    from_log,
    patch_truth,
    sample,
)
from roadeval.training.settings import TrainingSettings
from tests.training.making import frame, pipelines

PIPELINES = {
    # A plane is fitted and tabulated in half the time, and no test asks what was learnt.
    name: replace(
        pipeline,
        settings={**pipeline.settings, "svm": replace(pipeline.settings["svm"], kernel="linear")},
    )
    for name, pipeline in pipelines().items()
}


@dataclass(eq=False)
class Logged:
    """A frame of a log, as `logs` would hand it out."""

    frame: Frame
    broken: bool = False

    @property
    def number(self) -> int:
        return self.frame.number

    @property
    def labelled(self) -> bool:
        return self.frame.truth is not None

    def decode(self) -> Frame:
        if self.broken:
            raise RoadevalError("cannot be decoded")
        return self.frame


def log(count: int, unlabelled: tuple[int, ...] = (), broken: tuple[int, ...] = ()):
    return [Logged(frame(n, labelled=n not in unlabelled), n in broken) for n in range(count)]


def roles(frames, schedule: Schedule) -> str:
    """Give the roles' first letters: t(raining), c(opy), g(ap), u(nlabelled), e(valuated)."""
    return "".join(schedule.role(f.frame)[0] for f in frames)


def learn(logged, *, labelled: bool = True, **settings):
    chosen = TrainingSettings(**settings)
    return from_log(
        lambda only=None, **_: logged, PIPELINES, chosen, lambda done: None, labelled=labelled
    )


def test_the_first_labelled_frames_train_and_the_rest_is_evaluated():
    frames = log(8, unlabelled=(0, 2))
    _, schedule = learn(frames, frames=2)
    assert roles(frames, schedule) == "ututeeee"


def test_a_frame_that_equals_one_that_trained_is_a_copy_and_was_not_trained_on():
    frames = log(6)
    same = frames[0].frame
    for place in (3, 5):
        frames[place] = Logged(replace(same, number=place))
    _, schedule = learn(frames, frames=2)
    assert roles(frames, schedule) == "ttecec"


def test_frames_spread_along_the_drive_train_and_none_beside_them_is_evaluated():
    frames = log(18, unlabelled=(1, 9))
    _, schedule = learn(frames, frames=2, placement="spread", gap=1)
    assert roles(frames, schedule) == "tugeeeeegutgeeeeee"
    assert schedule.first == 3


@pytest.mark.parametrize(("count", "expected"), [(4, "tgeegtgeegtgeegtgeee"), (1, "tggggg")])
def test_the_gap_beside_spread_frames_is_a_quarter_of_their_distance(count, expected):
    frames = log(20)
    _, schedule = learn(frames, frames=count, placement="spread")
    assert roles(frames, schedule) == expected.ljust(20, "e")


def test_spread_frames_that_leave_nothing_to_evaluate_are_an_error():
    with pytest.raises(TrainingError, match=r"all 6 .* training \(3\) .* gap \(3\)"):
        learn(log(6), frames=3, placement="spread", gap=1)


def test_a_frame_that_cannot_be_decoded_is_replaced_by_the_next():
    frames = log(6, broken=(1,))
    model, schedule = learn(frames, frames=2)
    assert model.digests == {frames[0].frame.digest(), frames[2].frame.digest()}
    assert schedule.first == 3


def test_where_the_truth_labels_nothing_in_the_range_the_first_frames_train():
    frames = log(5, unlabelled=tuple(range(5)))
    model, schedule = learn(frames, frames=2)
    assert model.source == "patch"
    assert roles(frames, schedule) == "ttuuu"
    assert "no frame that is read has road truth: the model learnt from" in model.warnings[0]


def test_who_insists_on_truth_is_not_given_the_patch():
    with pytest.raises(TrainingError, match="no truth to train on"):
        learn(log(5, unlabelled=tuple(range(5))), frames=2, source="truth")


def test_training_frames_are_bounded_in_memory(monkeypatch):
    # A frame of 24x32 takes three images of 2304 bytes, a truth of 768, and its payload of 2304.
    monkeypatch.setattr(learning, "GREATEST_MEMORY", 3 * 9984)
    assert not learn(log(6), frames=3)[0].warnings
    with pytest.raises(TrainingError, match=r"more than 3 of them would take .*`frames.scale`"):
        learn(log(6), frames=4)


@pytest.mark.parametrize(("frames", "gap"), [(4, 0), (2, 2), (9, 0)])
def test_leaving_no_frame_to_evaluate_is_an_error(frames, gap):
    with pytest.raises(TrainingError, match=r"none is left to score; set `training\.frames`"):
        learn(log(4), frames=frames, gap=gap)


@pytest.mark.parametrize(
    ("count", "gap", "remedy"), [(4, 3, r"lower `training\.gap`, give"), (1, 0, r"score; give")]
)
def test_if_one_training_frame_is_too_many_none_is_advised(count, gap, remedy):
    with pytest.raises(TrainingError, match=f"none is left to .*{remedy}"):
        learn(log(count), frames=2, gap=gap)


def test_an_image_that_trained_is_recognised_wherever_it_lies():
    frames = log(5)
    _, schedule = learn(frames, frames=2)
    elsewhere = replace(frames[1].frame, number=77, stamp_ns=5)
    assert schedule.role(elsewhere) is Role.COPY


LABELLED = [frame(n) for n in range(2)]
BARE = [frame(n, labelled=False) for n in range(2, 4)]


def of_drives(source: str, **frames):
    drives = {Path(name): drive for name, drive in frames.items()}
    return from_drives(drives, PIPELINES, TrainingSettings(source=source))


def test_drives_without_truth_train_by_the_patch_and_this_is_said():
    model = of_drives("auto", a=BARE)
    assert model.source == "patch"
    assert "no drive has road truth in the range: the model learnt from" in model.warnings[0]


@pytest.mark.parametrize(
    ("source", "frames"),
    [
        ("auto", {"a": LABELLED, "b": BARE}),
        ("auto", {"a": LABELLED, "b": []}),
        ("truth", {"b": BARE}),
    ],
)
def test_a_drive_without_truth_among_others_is_named(source, frames):
    with pytest.raises(TrainingError, match=r"^b: no road truth to train on in the range"):
        of_drives(source, **frames)


# --- On top of a model of other drives ------------------------------------------------------------


def adapt(logged, path, pipelines, **settings):
    base, _ = from_file(path, pipelines)
    chosen = TrainingSettings(model=str(path), adapt=True, **settings)
    model, schedule = from_log(
        lambda only=None, **_: logged,
        pipelines,
        chosen,
        lambda done: None,
        labelled=True,
        base=base,
    )
    return base, model, schedule


@pytest.fixture
def robust(tmp_path):
    """The preset's pipeline, and a model of it."""
    small = {"trees": 3, "width": 32, "features": ("place", "colour")}
    made = {"unfiltered": configure({"preset": "robust", "trees": small}).pipeline}
    path = tmp_path / "city.model"
    save_model(fit([frame(n) for n in (50, 51)], made, TrainingSettings()), path)
    return made, path


def test_an_adapted_model_has_learnt_from_both_and_says_so(robust):
    pipelines, path = robust
    base, model, schedule = adapt(log(8), path, pipelines, frames=2, gap=1)
    adapted = model.parameters["unfiltered"]["trees"]
    assert adapted.base is base.parameters["unfiltered"]["trees"]
    assert base.digests < model.digests
    assert len(model.digests) == 4
    assert roles(log(8), schedule) == "ttgeeeee"
    (warning,) = [text for text in model.warnings if "adapted to this drive" in text]
    assert "2 of its own labelled frames" in warning
    assert str(path) in warning


def test_frames_that_the_model_learnt_from_are_not_evaluated_after_adapting_either(robust):
    pipelines, path = robust
    _, _, schedule = adapt(log(8), path, pipelines, frames=2)
    assert schedule.role(frame(50)) is Role.TRAINING


def test_without_truth_the_patch_adapts_only_where_that_is_insisted_on(robust):
    pipelines, path = robust
    logged = log(4, unlabelled=tuple(range(4)))
    with pytest.raises(TrainingError, match="no frame of the range has road truth to adapt"):
        adapt(logged, path, pipelines, frames=2)
    _, model, _ = adapt(logged, path, pipelines, frames=2, source="patch")
    assert model.source == "patch"
    assert any("by the reference patch" in text for text in model.warnings)


def test_a_variant_that_cannot_learn_further_is_refused(tmp_path):
    path = tmp_path / "city.model"
    save_model(fit([frame(0)], PIPELINES, TrainingSettings()), path)
    with pytest.raises(
        TrainingError, match=r"no stage of it can learn further \(similarity, svm\)"
    ):
        adapt(log(4), path, PIPELINES, frames=2)


FRAMES = [frame(n) for n in range(3)]


def test_a_fitted_variant_finds_the_road_in_a_new_frame():
    pipeline = pipelines()["unfiltered"]
    model = fit(FRAMES, {"unfiltered": pipeline}, TrainingSettings())
    chain = pipeline.bind(model.parameters["unfiltered"])
    fresh = frame(9)
    masks = {
        result.stage: result.output.mask.pixels() for result in chain.run(View.of(fresh.image))
    }
    for name in ("similarity", "svm", "post"):
        wrong = (masks[name] != fresh.truth).mean()
        assert wrong < 0.06, name


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


def test_one_class_alone_is_an_error_that_names_the_frames():
    sky = frame(4)
    sky.truth[:] = 0
    with pytest.raises(TrainingError, match="frames 4 to 4 do not show both road and non-"):
        fit([sky], pipelines(), TrainingSettings())


# --- Which pixels train ---------------------------------------------------------------------------

HALF = np.repeat([[1], [0]], [4, 4], axis=0).repeat(10, axis=1).astype(np.uint8)


def test_both_classes_are_drawn_equally_from_every_frame():
    pixels = sample([HALF, HALF], TrainingSettings(pixels_per_class=5))
    assert len(pixels.road) == 20
    for number in (0, 1):
        for road in (True, False):
            assert ((pixels.frame == number) & (pixels.road == road)).sum() == 5


def test_a_frame_without_road_still_gives_its_other_pixels():
    pixels = sample([np.zeros_like(HALF), HALF], TrainingSettings(pixels_per_class=4))
    assert (pixels.road.sum(), (~pixels.road).sum()) == (4, 4)
    assert set(pixels.frame[~pixels.road]) == {0, 1}


@pytest.mark.parametrize("frames", [1, 7, 60])
def test_the_sample_is_bounded_however_many_frames_there_are(frames):
    pixels = sample([HALF] * frames, TrainingSettings(max_pixels=40))
    assert len(pixels.road) <= 40


def test_the_seed_settles_the_draw():
    drawn = [sample([HALF], TrainingSettings(pixels_per_class=5, seed=s)) for s in (1, 1, 2)]
    np.testing.assert_array_equal(drawn[0].column, drawn[1].column)
    assert (drawn[0].column != drawn[2].column).any()


# --- What the reference patch teaches -------------------------------------------------------------

HEIGHT = 120
SETTINGS = TrainingSettings()


def street(grey=100, kerb=112, pavement=100, shade=0.8):
    """A street with noise, a kerb and a pavement on its right, and a shadow across its middle."""
    image = np.full((2 * HEIGHT, 2 * WIDTH, 3), float(grey))
    image[:, 2 * kerb :] = pavement
    image[:, 2 * kerb : 2 * kerb + 4] = 0.5 * grey
    image[120:150] *= shade
    noise = np.random.default_rng(0).normal(0, 1, image.shape[:2])
    return (image + noise[..., None]).clip(0, 255).astype(np.uint8)


def test_what_is_reached_without_crossing_a_kerb_is_road():
    truth = patch_truth(street(), SETTINGS)
    low = truth[100:]
    assert (low[:, :216] == ROAD).mean() > 0.99
    assert (low[:, 232:] == NON_ROAD).mean() > 0.99


def test_the_pavement_is_road_where_the_kerb_is_lowered():
    lowered = street()
    lowered[200:] = street(kerb=WIDTH)[200:]
    assert (patch_truth(lowered, SETTINGS)[100:, 232:] == ROAD).mean() > 0.5


def test_the_further_one_may_reach_the_more_is_road():
    shares = [
        (patch_truth(street(), TrainingSettings(far=far))[100:, 232:] == ROAD).mean()
        for far in (1.0, 20.0)
    ]
    assert shares[0] < 0.01
    assert shares[1] > 0.99


@pytest.mark.parametrize("shape", [(24, 32), (240, 320), (33, 47)])
def test_the_patch_is_road_whatever_it_shows(shape):
    image = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    truth = patch_truth(image, TrainingSettings(horizon=1.0, far=0.01))
    assert truth.dtype == np.uint8
    np.testing.assert_array_equal(truth == ROAD, patch_mask(*shape, ReferencePatch()) > 0)


# --- The model file: plain data, complete or refused, whatever array is damaged -------------------


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


@pytest.mark.parametrize(
    ("variant", "settings", "why"),
    [
        ("filtered", {"svm": {"gamma": 2.0}}, r"settings of svm .*gamma 0.5 there, 2.0 here"),
        ("night", {}, r"no variant night .it has filtered, unfiltered"),
    ],
)
def test_other_settings_and_variants_are_refused_by_name(path, variant, settings, why):
    with pytest.raises(RoadevalError, match=why):
        load_model(path).require(variant, configure(settings).pipeline, path)


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

    assert "not a model file" in refusal({"header": np.array([Trap()], object)}, tmp_path)


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
TRAINED = configure({"variants": EXTRA}).pipelines()


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
    model = fit([frame(n) for n in range(3)], TRAINED, settings)
    save_model(replace(model, prior=prior), path)
    from_file(path, TRAINED)
    with np.load(path) as archive:
        return dict(archive)


def refusal(arrays, folder: Path) -> str:
    """Write a model file and give the sentence that refuses it."""
    path = folder / "x.model"
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(RoadevalError) as caught:
        from_file(path, TRAINED)
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
        *("[]", "1", "{", "[" * 100_000, "\udcff"),
    ],
)
def test_a_damaged_header_and_one_that_is_none_are_refused(arrays, tmp_path, wrong):
    text = wrong
    if isinstance(wrong, dict):
        text = json.dumps(json.loads(arrays["header"].tobytes()) | wrong)
    header = np.frombuffer(text.encode(errors="surrogateescape"), np.uint8)
    told = "not a model file" if text is wrong else "model file"
    assert told in refusal({**arrays, "header": header}, tmp_path)
