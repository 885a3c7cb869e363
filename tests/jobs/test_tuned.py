"""A method that errs in the shade, and what ten frames of the drive make of it."""

import tomllib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
from onnx import helper

import roadeval
from roadeval import configure
from roadeval.config.tables import ConfigError
from roadeval.config.variants import network_variant
from roadeval.jobs.run.prepared import prepare
from roadeval.logs.log import open_log
from roadeval.networks import network as networks
from roadeval.results.verdict import verdicts
from roadeval.training.model import arrays_of
from tests.fixtures.logged import write_drive
from tests.networks.making import IMAGE, ROAD, red_network, written

SIZE = (48, 64)
NS = 100_000_000
TRAINED = 10
FRAMES = 22
SMALL = {
    "preset": "robust",
    "training": {"pixels_per_class": 200},
    "trees": {"width": 64, "trees": 8},
}


def picture(number):
    """A red road between green verges, half of it in the shade; house fronts are nearly as red."""
    height, width = SIZE
    rng = np.random.default_rng(number)
    image = np.empty((height, width, 3), np.uint8)
    image[:] = (60, 120, 50)
    image[: height // 3] = (140, 110, 100)
    rows, columns = np.indices(SIZE)
    middle = width / 2 + 6 * np.sin(number)
    road = (rows >= height // 3) & (np.abs(columns - middle) < 4 + rows * 0.4)
    image[road] = (150, 120, 110)
    edge = width * (0.3 + 0.4 * rng.random())
    image[columns < edge] = image[columns < edge] // 3
    noise = rng.integers(-6, 7, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8), road.astype(np.uint8)


def write(path, *, mirrored_truth_from=FRAMES, without=(), first=0):
    """A drive with masks that are blind to shade; some frames may have another truth, or none."""

    def messages(number):
        image, road = picture(first + number)
        truth = road if number < mirrored_truth_from else np.ascontiguousarray(road[::-1])
        mask = None if number in without else (image[..., 0] > 105).astype(np.uint8) * 255
        return {"/camera/image": image, "/truth/road": truth * 255, "/net/mask": mask}

    return write_drive(path, (((number + 1) * NS, messages(number)) for number in range(FRAMES)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuned")
    write(folder / "drive.mcap")
    red_network(folder / "red.onnx", size=SIZE[::-1])
    return folder


def with_network(folder, **tables):
    config = configure({**SMALL, **tables})
    config = config.with_variants([network_variant("mine", str(folder / "red.onnx"))])
    return small(config.with_tuned(["mine"]))


def small(config, methods=("mine",)):
    """The methods and what is tuned of them alone, with small trees."""
    trees = {each.name: {**each.pipeline.as_dict(), "preset": each.preset} for each in config.extra}
    for own in trees.values():
        if "trees" in own:
            own["trees"] = {**own["trees"], **SMALL["trees"]}
    names = [name for method in methods for name in (method, f"{method}_tuned")]
    return config.override({"variants": trees, "only": names})


def replay(drive, config, to):
    outcome = roadeval.replay(drive, config, reports=to)
    return outcome, pd.read_csv(to / "frames.csv")


def err(rows, variant, stage="post"):
    return rows.query("variant == @variant and stage == @stage").ERR.mean()


@pytest.fixture(scope="module")
def once(folder, tmp_path_factory):
    config = with_network(folder, output={"record": "none"})
    return replay(folder / "drive.mcap", config, tmp_path_factory.mktemp("once") / "r")


def test_a_network_that_is_blind_to_shade_is_mended(once):
    _, rows = once
    assert err(rows, "mine") > 0.2
    assert err(rows, "mine_tuned") < err(rows, "mine") / 5
    assert err(rows, "mine_tuned", "net") == err(rows, "mine")


def test_the_verdict_says_what_tuning_brings_to_its_method(once):
    outcome, rows = once
    change = outcome.summary["against_method"]["mine_tuned"]["ERR"]
    assert {*outcome.summary["against_method"]} == {"mine_tuned"}
    assert change["mean"] == pytest.approx(err(rows, "mine_tuned") - err(rows, "mine"))
    assert change["high"] < 0
    assert change["comparisons"] == 1
    best = f"Best here is mine_tuned: {100 * err(rows, 'mine_tuned'):.1f} %."
    assert best in outcome.summary["verdict"]


def shares(number):
    return picture(number)[0][..., 0].astype(np.float32) / 255


def confidences(folder):
    """How red each pixel is, beside the log; red things are road."""
    folder.mkdir()
    for number in range(FRAMES):
        np.save(folder / f"{number}.npy", shares(number))
    return {"path": str(folder), "threshold": 0.59}


def wrong(numbers, threshold):
    pairs = [(shares(n), picture(n)[1]) for n in numbers]
    return np.mean([((share > threshold) != road).mean() for share, road in pairs])


@pytest.fixture(scope="module")
def at_trained(folder, tmp_path_factory):
    to = tmp_path_factory.mktemp("trained")
    masks = {"mine": confidences(to / "a"), "other": {**confidences(to / "b"), "decide": "trained"}}
    alone = {"only": ["mine", "other"], "output": {"record": "none"}}
    config = configure({**SMALL, "masks": masks, **alone})
    return replay(folder / "drive.mcap", config, to / "r")


def test_the_headline_says_what_the_training_frames_threshold_would_bring(at_trained):
    outcome, _ = at_trained
    found = outcome.summary["thresholds"]
    assert {*found} == {"mine"}
    levels = np.arange(256) / 255 + 0.5 / 255
    best = min(wrong(range(TRAINED), level) for level in levels)
    threshold = found["mine"]["threshold"]
    assert wrong(range(TRAINED), threshold) == pytest.approx(best)
    scored = range(TRAINED, FRAMES)
    now, then = wrong(scored, 0.59), wrong(scored, threshold)
    assert found["mine"] == {
        "own": 0.59,
        "threshold": pytest.approx(threshold),
        "ERR": pytest.approx(then),
        "lines": found["mine"]["lines"],
    }
    told = f"Set `{found['mine']['lines']}`: then {100 * then:.1f} % are wrong."
    assert now > then
    assert told in verdicts(outcome.facts)["mine"]


def in_two_classes(path):
    """A network that decides by argmax, and calls too much road."""
    values = {
        "w": np.float32([[0, 0, 0], [20, 0, 0]]).reshape(2, 3, 1, 1),
        "b": np.float32([0, -3]),
    }
    return written(
        path, [helper.make_node("Conv", [IMAGE, "w", "b"], [ROAD])], values, size=(64, 48)
    )


@pytest.mark.parametrize("brought", ["masks", "network", "two classes"])
def test_the_lines_of_the_verdict_keep_their_promise(brought, folder, tmp_path):
    given, own = confidences(tmp_path / "a"), tmp_path / "own.toml"
    network = folder / "red.onnx"
    if brought == "two classes":
        network = in_two_classes(tmp_path / "two.onnx")

    def replayed(lines):
        masks = {"mine": {**given, **tomllib.loads(lines)}} if brought == "masks" else {}
        config = configure({"masks": masks, "output": {"record": "none"}})
        if not masks:
            own.write_text(f'file = "{network}"\n{lines}')
            config = config.with_variants([network_variant("mine", str(own))])
        config = config.override({"only": ["mine", "unfiltered"]})
        outcome, _ = replay(folder / "drive.mcap", config, tmp_path / "r")
        *_, final = outcome.summary["totals"]["mine"].values()
        return outcome.summary["thresholds"]["mine"], final["pooled_ERR"]

    found, before = replayed("")
    assert replayed(found["lines"])[1] == pytest.approx(found["ERR"]) != before


def test_decide_trained_takes_that_threshold(at_trained):
    outcome, rows = at_trained
    found = outcome.summary["thresholds"]["mine"]
    assert err(rows, "other", "threshold") == pytest.approx(found["ERR"])
    assert err(rows, "other") == err(rows, "other", "threshold")
    assert err(rows, "other", "given") == err(rows, "mine")
    assert any(each.startswith("other: its threshold is") for each in outcome.warnings)


def test_labels_of_scored_frames_do_not_choose_the_threshold(folder, tmp_path):
    masks = {"mine": {**confidences(tmp_path / "a"), "decide": "trained"}}
    config = configure({**SMALL, "masks": masks, "only": ["mine"]})
    codes = []
    for until in (FRAMES, TRAINED, 0):
        drive = write(tmp_path / f"{until}.mcap", mirrored_truth_from=until)
        with open_log(drive, config) as log:
            run = prepare(log, config.resolved(), lambda _: None)
        codes.append(run.model.parameters["mine"]["threshold"].code)
    assert codes[0] == codes[1] != codes[2]


def test_the_network_runs_once_a_frame(folder, tmp_path, monkeypatch):
    calls = []
    road = networks.Network.road

    def counted(self, image):
        calls.append(image)
        return road(self, image)

    monkeypatch.setattr(networks.Network, "road", counted)
    config = with_network(folder, output={"record": "none"}, run={"jobs": 1})
    outcome, _ = replay(folder / "drive.mcap", config, tmp_path / "r")
    in_training = TRAINED  # what it says of them
    assert len(calls) == FRAMES + in_training
    seconds = outcome.summary["seconds"]
    assert seconds["mine_tuned"]["net"] == seconds["mine"]["net"] > 0


def learnt(drive, config):
    with open_log(drive, config) as log:
        run = prepare(log, config.resolved(), lambda _: None)
    return arrays_of(run.model.parameters["mine_tuned"]["trees"])


def test_labels_of_scored_frames_change_nothing_that_is_learnt(folder, tmp_path):
    other = write(tmp_path / "other.mcap", mirrored_truth_from=TRAINED)
    config = with_network(folder)
    first, second = (learnt(each, config) for each in (folder / "drive.mcap", other))
    assert all(np.array_equal(first[name], second[name]) for name in first)
    third = learnt(write(tmp_path / "third.mcap", mirrored_truth_from=TRAINED - 1), config)
    assert not all(np.array_equal(first[name], third[name]) for name in first)


def test_masks_of_the_log_are_mended_too_and_frames_without_one_left_out(folder, tmp_path):
    drive = write(tmp_path / "drive.mcap", without=(15, 16))
    config = configure({**SMALL, "topics": {"masks": {"mine": "/net/mask"}}})
    outcome, rows = replay(drive, small(config.with_tuned(["mine"])), tmp_path / "r")
    assert err(rows, "mine") > 0.2
    assert err(rows, "mine_tuned") < err(rows, "mine") / 5
    scored = rows.groupby("variant").frame.nunique()
    assert scored["mine"] == scored["mine_tuned"] == FRAMES - TRAINED - 2
    assert not outcome.losses


def test_a_training_frame_without_a_mask_ends_the_run(folder, tmp_path):
    drive = write(tmp_path / "drive.mcap", without=(3,))
    config = configure({**SMALL, "topics": {"masks": {"mine": "/net/mask"}}})
    with pytest.raises(roadeval.RoadevalError, match="frame 3 has no mask of mine"):
        replay(drive, config.with_tuned(["mine"]), tmp_path / "r")


def test_what_was_learnt_elsewhere_is_used_and_adapted(folder, tmp_path):
    config = with_network(folder)
    roadeval.train(folder / "drive.mcap", tmp_path / "mine.model", config)
    drive = write(tmp_path / "drive.mcap")
    for adapt in (False, True):
        training = {"model": str(tmp_path / "mine.model"), "adapt": adapt, "frames": 4}
        own = config.override({"training": training, "frames": {"start": "1.05s"}})
        outcome, rows = replay(drive, own, tmp_path / f"{adapt}")
        told = "on other drives" if not adapt else "on other drives and this drive's first"
        assert any(told in each for each in outcome.warnings)
        assert err(rows, "mine_tuned") < err(rows, "mine") / 3


@pytest.mark.sweep
def test_in_a_fleet_each_drive_is_scored_by_what_others_taught(folder, tmp_path):
    """A network, and confidences beside the log, each with what is tuned of it."""
    drives = [write(tmp_path / f"{n}.mcap", first=100 * n) for n in range(2)]
    beside = {"beside": confidences(tmp_path / "shares")}
    methods = ["mine", "beside"]
    config = configure({**SMALL, "masks": beside, "fleet": {"folds": 2}})
    config = config.with_variants([network_variant("mine", str(folder / "red.onnx"))])
    config = small(config.with_tuned(methods), methods)
    with ThreadPoolExecutor(1) as executor:
        roadeval.replay_fleet(drives, tmp_path / "out", config, executor=executor)
    scores = roadeval.Result(tmp_path / "out").scores.query("stage == 'post'")
    errs = scores.pivot_table(index="drive", columns="variant", values="ERR")
    assert len(errs) == 2
    for method in methods:
        assert (errs[f"{method}_tuned"] < errs[method] / 3).all()


def test_a_model_is_refused_with_another_network(folder, tmp_path):
    config = with_network(folder)
    roadeval.train(folder / "drive.mcap", tmp_path / "mine.model", config)
    red_network(tmp_path / "red.onnx", size=SIZE[::-1], bias=-90)
    other = with_network(tmp_path, training={"model": str(tmp_path / "mine.model")})
    with pytest.raises(roadeval.RoadevalError, match="other settings of net"):
        replay(folder / "drive.mcap", other, tmp_path / "r")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("other", "there is no method other; choose mine"),
        ("robust", "is trained itself (trees)"),
    ],
)
def test_what_cannot_be_tuned(folder, name, told):
    config = configure(SMALL).with_variants([network_variant("mine", "n.onnx")])
    with pytest.raises(ConfigError, match=told.replace("(", r"\(").replace(")", r"\)")):
        config.with_tuned([name])


@pytest.mark.parametrize("is_network", [True, False])
def test_a_tuned_variant_takes_no_other_methods_place(is_network):
    """The user's own ``mine_tuned`` would be gone without a word."""
    other = {} if is_network else {"masks": {"mine_tuned": {"path": "masks"}}}
    networks = ["mine", "mine_tuned"] if is_network else ["mine"]
    made = [network_variant(name, "n.onnx") for name in networks]
    config = configure(SMALL | other).with_variants(made)
    with pytest.raises(ConfigError, match="the name is taken"):
        config.with_tuned(["mine"])
    alone = configure(SMALL).with_variants([network_variant("mine", "n.onnx")])
    once = alone.with_tuned(["mine"])
    assert once.with_tuned(["mine"]) == once
