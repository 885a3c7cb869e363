"""Forty ways in which a network may end, all with the same road: where blue is below one half."""

import hashlib
import json
import tomllib
from dataclasses import asdict

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from PIL import Image

from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.networks.network import fit_image, fit_size, input_values, samples_of
from tests.networks.making import (
    IMAGE,
    ROAD,
    SIZE,
    balanced,
    by_ultralytics,
    network,
    scores,
    written,
)

pytestmark = pytest.mark.usefixtures("opened_here_alone")

RNG = np.random.default_rng(3)
EXPECTED = RNG.integers(0, 2, (SIZE[1], SIZE[0]), np.uint8)
FRAME = np.stack([RNG.integers(0, 256, EXPECTED.shape)] * 2 + [255 - 200 * EXPECTED - 20], axis=-1)
FRAME = FRAME.astype(np.uint8)

HALF, FLOAT, DOUBLE = TensorProto.FLOAT16, TensorProto.FLOAT, TensorProto.DOUBLE
WEIGHTS = {
    "w1": np.float32([0, 0, -12]).reshape(1, 3, 1, 1),
    "b1": np.float32([6]),
    "w2": np.float32([[0, 0, 0], [0, 0, -12]]).reshape(2, 3, 1, 1),
    "b2": np.float32([0, 6]),
    "zero": np.float32(0),
    "one": np.float32(1),
    "half": np.float32(0.5),
    "first": np.int64([0]),
    "last": np.int64([1]),
    "end": np.int64([2]),
    "axis": np.int64([1]),
    "second": np.int64(1),
    "fine": np.float32(1 / 255),
    "coarse": np.float32(0.1),
    "bottom": np.uint8(0),
    "middle": np.int8(0),
    "three": np.int64(3),
    "seven": np.int64(7),
}
ONE, TWO = "Conv w1 b1", "Conv w2 b2"
"""The logit of road, and those of the rest and of road."""
MAP = f"{TWO}; ArgMax axis=1"
ROUND = "QuantizeLinear fine bottom; DequantizeLinear fine bottom"
ROUGH = "QuantizeLinear coarse middle; DequantizeLinear coarse middle"

PROBABILITIES = [
    f"{ONE}; Sigmoid",
    f"{ONE}; Sigmoid; Identity",
    f"{ONE}; Sigmoid; Add zero",
    f"{ONE}; Sigmoid; Mul one",
    f"{ONE}; Sigmoid; {ROUND}",
    f"{ONE}; {ROUGH}; Sigmoid; {ROUND}",
    f"{ONE}; Sigmoid; Cast to={HALF}",
    f"{ONE}; Sigmoid; Cast to={DOUBLE}",
    f"{ONE}; Sigmoid; Cast to={HALF}; Cast to={FLOAT}",
    f"{ONE}; Sigmoid; Clip zero one",
    f"{ONE}; Sigmoid; Squeeze axis",
    f"{ONE}; Sigmoid; Mean @; Add zero",
    f"{ONE}; Neg; Sigmoid; Neg; Add one",
    f"{ONE}; HardSigmoid",
    f"{TWO}; Softmax axis=1",
    f"{TWO}; Softmax axis=1; {ROUND}",
    f"{TWO}; Softmax axis=1; Mul one",
    f"{TWO}; Softmax axis=1; Gather second axis=1",
    f"{TWO}; Softmax axis=1; Gather last axis=1",
    f"{TWO}; Softmax axis=1; Slice last end axis",
    f"{TWO}; Softmax axis=1; Slice last end axis; {ROUND}",
    f"{TWO}; Softmax axis=1; Cast to={HALF}",
    f"{TWO}; Sigmoid; Gather last axis=1",
]
LOGITS = [
    ONE,
    f"{ONE}; Identity",
    f"{ONE}; Mul half",
    f"{ONE}; {ROUGH}",
    f"{ONE}; Cast to={HALF}",
    f"{ONE}; Squeeze axis",
    TWO,
    f"{TWO}; {ROUGH}",
    f"{TWO}; LogSoftmax axis=1",
]
MAPS = {
    MAP: 1,
    f"{MAP} keepdims=0": 1,
    f"{MAP}; Cast to={FLOAT}": 1,
    f"{MAP}; Cast to={HALF}": 1,
    f"{MAP}; Cast to={TensorProto.UINT8}": 1,
    f"{TWO}; Neg; ArgMax axis=1; Cast to={FLOAT}": 0,
    f"{ONE}; Greater zero": 1,
    f"{ONE}; Greater zero; Cast to={FLOAT}": 1,
    f"{ONE}; Greater zero; Where seven three; Cast to={FLOAT}": 7,
}


def ended(path, ending, size=SIZE):
    """Write a network of operators, one after the other, each with further inputs and settings."""
    nodes, before = [], IMAGE
    *steps, last = ending.split("; ")
    for place, step in enumerate([*steps, last]):
        operator, *rest = step.split()
        settings = dict(part.split("=") for part in rest if "=" in part)
        more = [before if part == "@" else part for part in rest if "=" not in part]
        after = ROAD if place == len(steps) else f"made {place}"
        numbers = {name: int(value) for name, value in settings.items()}
        nodes.append(helper.make_node(operator, [before, *more], [after], **numbers))
        before = after
    kinds = {"ArgMax": TensorProto.INT64, "Greater": TensorProto.BOOL}
    kind = int(last.partition("to=")[2] or kinds.get(last.split()[0], FLOAT))
    return written(path, nodes, WEIGHTS, kind=kind, size=size)


def road_of(path, ending, frame=FRAME, **settings):
    net = Network.of(NetSettings(file=str(ended(path, ending)), **settings))
    return net, net.road(frame).mask.pixels()


@pytest.mark.parametrize("ending", [*PROBABILITIES, *LOGITS, *MAPS])
def test_however_a_network_ends_its_road_is_the_same(ending, tmp_path):
    chosen = {"road": (MAPS[ending],)} if ending in MAPS else {}
    net, mask = road_of(tmp_path / "n.onnx", ending, **chosen)
    assert np.array_equal(mask, EXPECTED)
    kind = "probabilities" if ending in PROBABILITIES else "logits"
    assert net.facts()["taken_for"] == ("classes" if ending in MAPS else kind)


def test_logits_are_interpolated_and_not_probabilities(tmp_path):
    frame = cv2.resize(FRAME, (37, 29), interpolation=cv2.INTER_NEAREST)
    blue = cv2.resize(frame, SIZE)[..., 2].astype(np.float32)
    expected = cv2.resize(0.5 - blue / 255, (37, 29)) > 0
    for ending in (ONE, TWO, f"{TWO}; LogSoftmax axis=1"):
        _, mask = road_of(tmp_path / "n.onnx", ending, frame)
        assert np.array_equal(mask, expected)


def test_logits_that_are_called_probabilities_are_refused(tmp_path):
    with pytest.raises(NetworkError, match=r"no probabilities; see `net\.activation`"):
        road_of(tmp_path / "n.onnx", ONE, activation="none")


def test_scores_of_several_classes_are_no_map_of_classes(tmp_path):
    with pytest.raises(NetworkError, match="not a map of the image"):
        road_of(tmp_path / "n.onnx", TWO, activation="classes", road=(1,))


def test_whole_numbers_that_are_quantised_probabilities_are_no_classes(tmp_path):
    ending = f"{ONE}; Mul half; Sigmoid; QuantizeLinear fine bottom; Cast to={TensorProto.UINT8}"
    path = ended(tmp_path / "n.onnx", ending, (160, 120))
    with pytest.raises(NetworkError, match="DequantizeLinear"):
        Network.of(NetSettings(file=str(path), road=(1,)))


@pytest.mark.parametrize("road", [None, (0,), (1,)])
def test_of_a_single_class_ultralytics_writes_road_as_1(road, tmp_path):
    """``pred.gt(0)`` in ``SemanticSegmentationPredictor.postprocess``, and in its export."""
    path = ended(tmp_path / "n.onnx", f"{ONE}; Greater zero; Cast to={TensorProto.UINT8}")
    net = Network.of(NetSettings(file=str(by_ultralytics(path, {0: "road"})), road=road))
    assert np.array_equal(net.road(FRAME).mask.pixels(), EXPECTED)
    assert (net.settings.road, net.settings.resize) == ((1,), "letterbox")


def test_of_several_classes_ultralytics_names_say_which_is_road(tmp_path):
    path = by_ultralytics(ended(tmp_path / "n.onnx", MAP), {0: "car", 1: "road"})
    assert np.array_equal(
        Network.of(NetSettings(file=str(path))).road(FRAME).mask.pixels(), EXPECTED
    )


def test_class_maps_of_ultralytics_come_back_as_its_own_do(tmp_path):
    """By ``torch.nn.functional.interpolate(mode="nearest")``: the pixel at or before the place."""
    path = by_ultralytics(ended(tmp_path / "n.onnx", MAP), {0: "car", 1: "road"})
    frame = cv2.resize(FRAME, (40, 30), interpolation=cv2.INTER_NEAREST)
    net = Network.of(NetSettings(file=str(path)))
    small = net.road(cv2.resize(frame, SIZE)).mask.pixels()
    rows, columns = (np.arange(n) * m // n for n, m in zip((30, 40), (12, 16), strict=True))
    assert np.array_equal(net.road(frame).mask.pixels(), small[np.ix_(rows, columns)])


@pytest.mark.parametrize("size", [(37, 29), (16, 12), (9, 31), (80, 60)])
@pytest.mark.parametrize("antialias", [True, "bicubic"])
def test_an_antialiased_image_is_pillows(antialias, size):
    settings = NetSettings(file="n", size=size, resize="stretch", antialias=antialias)
    image = RNG.integers(0, 256, (47, 61, 3), np.uint8)
    how = Image.Resampling.BILINEAR if antialias is True else Image.Resampling.BICUBIC
    expected = np.asarray(Image.fromarray(image).resize(size, how))
    assert np.array_equal(fit_image(image, settings), expected)


@pytest.mark.parametrize("dtype", ["float16", "float32"])
def test_levels_become_the_values_that_a_division_by_255_gives(dtype):
    """As makers' code divides; half precision tells a product with 1/255 from it."""
    settings = NetSettings(scale=1 / 255, mean=(0.0,), deviation=(1.0,), layout="NHWC")
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    values = input_values(levels, settings, dtype)[0]
    assert np.array_equal(values, levels.astype(dtype) / np.dtype(dtype).type(255))


@pytest.mark.parametrize("sign", ["task", "boxes", "queries", "their lengths"])
def test_a_network_that_finds_instances_is_called_so(sign, tmp_path):
    path = network(tmp_path / "n.onnx", spare=True)
    if sign == "task":
        by_ultralytics(path, {0: "road"}, task="segment")
    elif sign == "their lengths":
        model = onnx.load(path)
        net = helper.make_tensor_value_info("found", TensorProto.FLOAT, (1, 2, 48))
        length = helper.make_node("Constant", [], ["lengths"], value_ints=[1, 2, 48])
        model.graph.node.extend([length, helper.make_node("Reshape", [ROAD, "lengths"], ["found"])])
        model.graph.output.append(net)
        onnx.save(model, path)
    else:
        model = onnx.load(path)
        model.graph.node[-1].output[0] = model.graph.output[0].name = f"pred_{sign}"
        onnx.save(model, path)
    with pytest.raises(NetworkError, match=r"finds instances.*semantic"):
        Network.of(NetSettings(file=str(path)))


# --- What makers of networks state in metadata and in JSON files, and questions for the rest ------


PICTURE = np.random.default_rng(5).integers(0, 256, (12, 16, 3), np.uint8)
ENLARGED = cv2.resize(PICTURE, (48, 30), interpolation=cv2.INTER_CUBIC)
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
    made = {
        "classes": 3,
        "values": balanced(PICTURE, 3),
        "input_shape": ("n", "c", "h", "w"),
    } | made
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
    values = balanced(PICTURE, 3)
    path = network(tmp_path / "n.onnx", classes=3, values=values)
    net = opened(by_ultralytics(path, {0: "car", 1: "sky", 2: "road"}, imgsz=[12, 16], stride=8))
    boxed = np.full((12, 16, 3), 114, np.uint8)
    boxed[1:11] = cv2.resize(ENLARGED, (16, 10))
    planes = scores(values, boxed.transpose(2, 0, 1) / 255).astype(np.float32)
    logits = [cv2.resize(cv2.resize(plane, (16, 12))[1:11], (48, 30)) for plane in planes]
    assert np.array_equal(net.road(ENLARGED).mask.pixels(), np.argmax(logits, axis=0) == 2)
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
    values = balanced(PICTURE, 3)
    planes = ((PICTURE / 255 - (0.4, 0.5, 0.6)) / (0.2, 0.25, 0.3)).transpose(2, 0, 1)
    logits = [cv2.resize(p.astype(np.float32), (16, 12)) for p in scores(values, planes)]
    assert np.array_equal(net.road(PICTURE).mask.pixels(), np.argmax(logits, axis=0) == 2)
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


def test_mobilevit_does_not_normalise_unless_its_folder_asks_for_it(tmp_path):
    """Its files have no ``do_normalize``, but those of transformers 5 have a mean."""
    folder = folder_of(tmp_path, preprocessing={"image_processor_type": "MobileViTImageProcessor"})
    path = folder / "preprocessor_config.json"
    stated = json.loads(path.read_text())
    assert opened(folder).settings.mean == (0.4, 0.5, 0.6)
    for name in ("do_normalize", "image_mean", "image_std"):
        del stated[name]
        path.write_text(json.dumps(stated))
        settings = opened(folder).settings
        assert (settings.mean, settings.deviation) == ((0.0,), (1.0,))


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
