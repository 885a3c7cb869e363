"""Frames of whole drives, every layer against the plain pipeline; and what noise may cost."""

from pathlib import Path
from time import thread_time
from typing import Final

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.paper import post
from roadeval.pipeline.paper.shadow import connected_components
from roadeval.pipeline.stage import Output, TrainingSet, View
from roadeval.pipeline.stages import STAGES
from roadeval.runtime.threads import one_thread_each
from tests.fixtures.shared import shared
from tests.pipeline import reference
from tests.pipeline.making import SETTINGS, default

DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"
TRAINING, CHECKED = (0, 3, 6, 9), (12, 78)
OTHER, ROAD, IGNORED = 0, 1, 2


def messages(path, factory):
    """Return the decoded messages in use, by topic and frame number."""
    by_topic, numbers = {}, {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[factory])
        for _, channel, _, message in reader.iter_decoded_messages():
            number = numbers[channel.topic] = numbers.get(channel.topic, -1) + 1
            if number in TRAINING + CHECKED:
                by_topic.setdefault(channel.topic, {})[number] = message
    return by_topic


def decoded(message, flags):
    return cv2.imdecode(np.frombuffer(message.data, np.uint8), flags)


def rgb(message):
    return cv2.cvtColor(decoded(message, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def demo():
    """The synthetic drive that ships, whose masks hold 0 and 255."""
    by_topic = messages(DEMO, Protobuf())
    masks = by_topic["/truth/road"]
    truths = {n: np.where(decoded(m, cv2.IMREAD_GRAYSCALE), ROAD, OTHER) for n, m in masks.items()}
    return {n: rgb(m) for n, m in by_topic["/camera/image"].items()}, truths


def street():
    """A real drive whose truth is class ids."""
    (path,) = shared("drives", "camvid_0016E5_15hz.mcap")
    by_topic = messages(path, Ros2())
    truths = {}
    for number, message in by_topic["/labels/semantic"].items():
        rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
        classes = rows[:, : message.width]
        truths[number] = np.select([classes == 3, classes == 11], [ROAD, IGNORED], OTHER)
    return {n: rgb(m) for n, m in by_topic["/camera/image_raw/compressed"].items()}, truths


@pytest.fixture(scope="module", params=[demo, street] if shared() else [demo])
def drive(request):
    """The images and the truth of the frames in use, by number."""
    return request.param()


def sample(images, truths, count=40):
    """As many road as other pixels of count frame."""
    rng = np.random.default_rng(0)
    parts = []
    for frame, truth in enumerate(truths):
        for road in (True, False):
            where = np.argwhere(truth == (ROAD if road else OTHER))
            rows, columns = where[rng.choice(len(where), count, replace=False)].T
            parts.append((np.full(count, frame), rows, columns, np.full(count, road)))
    return TrainingSet(tuple(images), *map(np.concatenate, zip(*parts, strict=True)))


@pytest.mark.parametrize("filtered", [True, False], ids=["filtered", "unfiltered"])
@pytest.mark.parametrize("preset", ["paper", "printed"])
def test_every_layer_equals_the_plain_pipeline(drive, preset, filtered):
    images, truths = drive
    settings, printed = SETTINGS[preset], preset == "printed"
    names = ("shadow", "similarity", "svm", "post")[0 if filtered else 1 :]
    seen = [images[number] for number in TRAINING]
    if filtered:
        (step,) = Pipeline(names[:1], settings).bind({}).steps
        seen = [step.run(View.of(image)).image for image in seen]
    training = sample(seen, [truths[number] for number in TRAINING])
    fitted = {name: STAGES[name].fit(training, settings[name]) for name in ("similarity", "svm")}
    chain = Pipeline(names, settings).bind(fitted)
    model = reference.train(training.colours(), training.road, settings["svm"].kernel)

    # Colours in single precision are off by up to this; a distance divides by the road's deviation,
    # which is least where its colours lie nearly on a line.
    rounding = 255 * np.finfo(np.float32).eps
    off = rounding / np.sqrt(np.linalg.eigvalsh(model.road.covariance_)[0] + 1.0)
    for number in CHECKED:
        expected = reference.layers(images[number], model, filtered=filtered, printed=printed)
        layers = {
            layer.spec.name: layer.array
            for result in chain.run(View.of(images[number]))
            for layer in result.output.layers
        }
        assert list(layers) == list(expected)
        for name, array in layers.items():
            if name == "distance":
                np.testing.assert_allclose(array, expected[name], rtol=1e-6, atol=off)
            else:
                np.testing.assert_array_equal(array, expected[name], err_msg=f"{number} {name}")


SMALL, LARGE = (180, 320), (1440, 2560)
"""One is 64 times the other: what grew with the square would take 64 times as long a pixel."""
MOST: Final = 8
"""Times as long a pixel, the geometric mean of 1 and 64: without compiled loops caches alone make a
factor of 3."""


def specks(shape):
    """Grey, with a saturated pixel in the middle of many a square of 3 x 3: each a component."""
    rng = np.random.default_rng(0)
    image = np.full((*shape, 3), 128, np.uint8)
    centres = image[1::3, 1::3]
    coloured = rng.random(centres.shape[:2]) < 0.7
    centres[coloured] = rng.choice([0, 255], (coloured.sum(), 3))
    centres[coloured, 1] = 0
    return image


def components_and_seconds(shape, runs):
    """How many components the filter finds, and the least CPU time of filter and morphology."""
    image, seconds = specks(shape), []
    chain = default("shadow").bind({})
    # Without the opening, which would remove the specks before they are labelled.
    process = post.bind(post.PostSettings(operations=()), None)
    with one_thread_each():
        for _ in range(runs):
            start = thread_time()
            (result,) = chain.run(View.of(image))
            shadow = result.output.regions["shadow"]
            process(View.of(image).after(Output(mask=shadow)))
            seconds.append(thread_time() - start)
    components = connected_components(shadow, 8)
    return components.count, min(seconds)


@pytest.fixture(scope="module")
def measured():
    components_and_seconds(SMALL, 1)  # warms up
    return {shape: components_and_seconds(shape, 5) for shape in (SMALL, LARGE)}


def test_the_noise_makes_very_many_components(measured):
    assert measured[LARGE][0] > 50_000
    assert measured[LARGE][0] > 40 * measured[SMALL][0]


def test_the_time_a_pixel_does_not_grow_with_the_number_of_components(measured):
    small, large = (seconds / np.prod(shape) for shape, (_, seconds) in measured.items())
    assert large < MOST * small
