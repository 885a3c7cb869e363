"""What makers of networks state in metadata and in JSON files, and questions for the rest."""

import hashlib
import json
import tomllib
from dataclasses import asdict

import cv2
import numpy as np
import pytest

from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.networks.network import fit_size, samples_of
from tests.networks.making import balanced, by_ultralytics, network, scores

pytestmark = pytest.mark.usefixtures("opened_here_alone")

IMAGE = np.random.default_rng(5).integers(0, 256, (12, 16, 3), np.uint8)
FRAME = cv2.resize(IMAGE, (48, 30), interpolation=cv2.INTER_CUBIC)
PREPROCESSING = {
    "do_resize": True,
    "size": {"height": 12, "width": 16},
    "resample": 2,
    "do_rescale": True,
    "rescale_factor": 1 / 255,
    "do_normalize": True,
    "image_mean": [0.4, 0.5, 0.6],
    "image_std": [0.2, 0.25, 0.3],
}
ANY_SIZE = ("n", 3, "h", "w")


def folder_of(folder, config=None, preprocessing=None, inner="model.onnx", **made):
    """Write a folder of Hugging Face with a network of three classes."""
    (folder / inner).parent.mkdir(parents=True, exist_ok=True)
    made = {"classes": 3, "values": balanced(IMAGE, 3), "input_shape": ("n", "c", "h", "w")} | made
    network(folder / inner, **made)
    names = {"0": "sky", "1": "car", "2": "Road"}
    (folder / "config.json").write_text(json.dumps(config or {"id2label": names}))
    stated = PREPROCESSING | (preprocessing or {})
    (folder / "preprocessor_config.json").write_text(json.dumps(stated))
    return folder


def opened(path, **settings) -> Network:
    return Network.of(NetSettings(file=str(path), **settings))


def refused(path, **settings) -> NetworkError:
    with pytest.raises(NetworkError) as caught:
        opened(path, **settings)
    assert "\n" not in str(caught.value)
    return caught.value


# --- Ultralytics ----------------------------------------------------------------------------------


def test_logits_of_a_letterbox_lose_its_edge_and_are_interpolated_to_the_frame(
    tmp_path,
):
    """First to the input's size, then to the frame's, as ``ops.scale_masks`` is called."""
    values = balanced(IMAGE, 3)
    path = network(tmp_path / "n.onnx", classes=3, values=values)
    net = opened(by_ultralytics(path, {0: "car", 1: "sky", 2: "road"}, imgsz=[12, 16], stride=8))
    boxed = np.full((12, 16, 3), 114, np.uint8)
    boxed[1:11] = cv2.resize(FRAME, (16, 10))
    planes = scores(values, boxed.transpose(2, 0, 1) / 255).astype(np.float32)
    logits = [cv2.resize(cv2.resize(plane, (16, 12))[1:11], (48, 30)) for plane in planes]
    assert np.array_equal(net.road(FRAME).mask.pixels(), np.argmax(logits, axis=0) == 2)
    expected = 'road = class 2 "road" of 3; letterbox 16x12; logits at 1/2'
    assert net.facts()["reading"] == expected


def test_a_network_of_ultralytics_for_any_size_has_the_smallest_letterbox_of_its_stride(tmp_path):
    path = network(tmp_path / "n.onnx", input_shape=ANY_SIZE)
    by_ultralytics(path, {0: "car", 1: "road"}, imgsz=[64, 64], stride=16)
    net = opened(path)
    assert (net.settings.size, net.settings.stride) == ((64, 64), 16)
    fitted = fit_size(net.settings, (128, 70))
    assert fitted.size == (64, 48)
    assert samples_of(fitted, net.file)[0].shape == (1, 2, 24, 32)
    assert net.road(np.zeros((70, 128, 3), np.uint8)).mask.shape == (70, 128)
    assert opened(path, size=(32, 32)).settings.stride is None


@pytest.mark.parametrize("task", ["depth", "classify"])
def test_a_network_of_ultralytics_for_another_task_is_refused(task, tmp_path):
    path = by_ultralytics(network(tmp_path / "n.onnx"), {0: "road"}, task=task)
    assert f"is for the task {task}" in str(refused(path))


@pytest.mark.parametrize("names", ["{-1: 'road', 0: 'car'}", "{1e999: 'road', 0: 'car'}"])
def test_names_with_impossible_numbers_are_no_classes(names, tmp_path):
    path = by_ultralytics(network(tmp_path / "n.onnx", classes=3), names)
    assert "tells 3 classes apart" in str(refused(path))


# --- Hugging Face ---------------------------------------------------------------------------------


@pytest.mark.parametrize("inner", ["model.onnx", "onnx/model.onnx"])
def test_a_folder_tells_classes_and_input(inner, tmp_path):
    net = opened(folder_of(tmp_path / "segformer", inner=inner))
    settings = net.settings
    assert (settings.size, settings.road, settings.antialias) == ((16, 12), (2,), True)
    values = balanced(IMAGE, 3)
    planes = ((IMAGE / 255 - (0.4, 0.5, 0.6)) / (0.2, 0.25, 0.3)).transpose(2, 0, 1)
    logits = [cv2.resize(p.astype(np.float32), (16, 12)) for p in scores(values, planes)]
    assert np.array_equal(net.road(IMAGE).mask.pixels(), np.argmax(logits, axis=0) == 2)
    assert net.facts()["file"] == "segformer"
    assert net.reading() == 'road = class 2 "road" of 3; stretched to 16x12; logits at 1/2'
    # Its settings, as run.toml states them, open the same network.
    assert Network.of(settings).settings == settings


def test_the_digest_covers_all_that_was_read_of_a_folder(tmp_path):
    folder = folder_of(tmp_path)
    names = ("model.onnx", "config.json", "preprocessor_config.json")
    content = b"".join((folder / name).read_bytes() for name in names)
    assert opened(folder).settings.sha256 == hashlib.sha256(content).hexdigest()
    settings = opened(folder).settings
    (folder / "config.json").write_text('{"id2label": {"1": "road"}}')
    with pytest.raises(NetworkError, match="another network"):
        Network.of(settings)


STEPS = {
    "no rescaling": ({"do_rescale": False}, {"scale": 1.0}),
    "no normalisation": ({"do_normalize": False}, {"mean": (0.0,), "deviation": (1.0,)}),
    "bicubic": ({"resample": 3}, {"antialias": "bicubic"}),
    "blue first": ({"do_flip_channel_order": True}, {"channels": "bgr"}),
    "one side": (
        {"size": 20, "feature_extractor_type": "SegformerFeatureExtractor"},
        {"size": (20, 20)},
    ),
}


@pytest.mark.parametrize("what", STEPS)
def test_steps_of_preprocessing_become_settings(what, tmp_path):
    changed, expected = STEPS[what]
    settings = asdict(opened(folder_of(tmp_path, preprocessing=changed)).settings)
    assert {name: settings[name] for name in expected} == expected


def test_names_can_stand_the_other_way_round(tmp_path):
    folder = folder_of(tmp_path, {"label2id": {"sky": 0, "road": 1, "car": 2}})
    assert opened(folder).settings.road == (1,)


def test_numbered_labels_and_names_of_no_class_are_no_names(tmp_path):
    names = {"0": "LABEL_0", "1": "LABEL_1", "7": "road"}
    assert refused(folder_of(tmp_path, {"id2label": names})).draft.endswith("road = [?]")


UNUSABLE = {
    "a crop": ({"preprocessing": {"do_center_crop": True}}, "set do_center_crop to false"),
    "a filter": ({"preprocessing": {"resample": 1}}, "resample 1"),
    "a mean of four": ({"preprocessing": {"image_mean": [1, 2, 3, 4]}}, "damaged: mean: "),
    "a size of text": ({"preprocessing": {"size": {"height": "x", "width": 2}}}, "damaged: size.1"),
    "names that are none": ({"config": {"id2label": ["road"]}}, "config.json: damaged: "),
    "sizes of the frame": ({"preprocessing": {"size": {"shortest_edge": 9}}}, "of any size"),
}


@pytest.mark.parametrize("what", UNUSABLE)
def test_a_folder_that_cannot_be_used_is_one_clear_line(what, tmp_path):
    made, message = UNUSABLE[what]
    assert message in str(refused(folder_of(tmp_path, **made)))


@pytest.mark.parametrize("name", ["model.onnx", "config.json", "preprocessor_config.json"])
@pytest.mark.parametrize("content", [None, "{", "[]"])
def test_a_missing_or_damaged_file_of_a_folder_is_named(name, content, tmp_path):
    folder = folder_of(tmp_path)
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    assert name in str(refused(folder))


# --- What is asked --------------------------------------------------------------------------------


def filled(draft: str, value: str) -> NetSettings:
    """Return the settings of a draft with a value in place of its question mark."""
    return NetSettings(**tomllib.loads(draft.replace("?", value)))


@pytest.mark.parametrize("names", [{}, {0: "car", 1: "Drivable area", 2: "sky"}])
def test_a_question_about_classes_has_a_draft_that_lacks_their_numbers(names, tmp_path):
    path = network(tmp_path / "n.onnx", classes=3, metadata={"names": str(names)})
    error = refused(path)
    assert ('maybe 1 "drivable area"' in str(error)) == bool(names)
    assert error.draft.endswith('road = [?]  # 1 "drivable area"' if names else "road = [?]")
    assert Network.of(filled(error.draft, "1")).settings.road == (1,)


def test_names_of_two_classes_decide_which_is_road(tmp_path):
    first, other = ({0: "road", 1: "rest"}, {0: "lane", 1: "rest"})
    path = network(tmp_path / "n.onnx", metadata={"names": str(first)})
    assert opened(path).settings.road == (0,)
    path = network(tmp_path / "m.onnx", metadata={"names": str(other)})
    assert 'maybe 0 "lane"' in str(refused(path))


def test_questions_about_outputs_sizes_and_layouts_have_a_draft(tmp_path):
    path = network(tmp_path / "n.onnx", spare=True)
    draft = refused(path).draft
    assert draft.endswith('outputs = [?]  # some of "road", "r1"')
    assert Network.of(filled(draft, '"road"')).settings.outputs == ("road",)
    path = network(tmp_path / "m.onnx", input_shape=ANY_SIZE)
    assert Network.of(filled(refused(path).draft, "16")).settings.size == (16, 16)
    path = network(tmp_path / "o.onnx", input_shape=("n", "c", "h", "w"))
    assert Network.of(filled(f"size = [16, 12]\n{refused(path).draft}", '"NCHW"')).settings.size
