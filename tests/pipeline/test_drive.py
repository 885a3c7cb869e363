"""Five frames of a real drive, every layer against the plain pipeline."""

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from roadeval.pipeline.chain import STAGES, Pipeline
from roadeval.pipeline.stage import TrainingSet, View
from tests.pipeline import reference
from tests.pipeline.making import SETTINGS

TRAINING, CHECKED = (0, 3, 6, 9), (12, 34, 56, 78, 100)
ROAD, IGNORED = 3, 11


@pytest.fixture(scope="module")
def drive(data):
    """The images and the truth of the frames in use, by frame number."""
    images, truths = {}, {}
    with (data / "drives" / "camvid_0016E5_15hz.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        numbers = {}
        for _, channel, _, message in reader.iter_decoded_messages():
            number = numbers[channel.topic] = numbers.get(channel.topic, -1) + 1
            if number not in TRAINING + CHECKED:
                continue
            if "labels" in channel.topic:
                rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
                truths[number] = rows[:, : message.width]
            else:
                bgr = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
                images[number] = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
    return images, truths


def sample(images, truths, each=40):
    """As many road as other pixels of each frame."""
    rng = np.random.default_rng(0)
    parts = []
    for frame, truth in enumerate(truths):
        for road in (True, False):
            where = np.argwhere(truth == ROAD if road else ~np.isin(truth, (ROAD, IGNORED)))
            rows, columns = where[rng.choice(len(where), each, replace=False)].T
            parts.append((np.full(each, frame), rows, columns, np.full(each, road)))
    return TrainingSet(tuple(images), *map(np.concatenate, zip(*parts, strict=True)))


@pytest.mark.parametrize("filtered", [True, False], ids=["filtered", "unfiltered"])
@pytest.mark.parametrize("preset", ["paper", "printed"])
def test_every_layer_equals_the_plain_pipeline(drive, preset, filtered):
    images, truths = drive
    settings, printed = SETTINGS[preset], preset == "printed"
    names = ("shadow", "similarity", "svm", "post")[0 if filtered else 1 :]
    before = Pipeline(names[:1] if filtered else (), settings).bind({})
    seen = [before.filtered(images[number]) for number in TRAINING]
    training = sample(seen, [truths[number] for number in TRAINING])
    fitted = {name: STAGES[name].fit(training, settings[name]) for name in ("similarity", "svm")}
    chain = Pipeline(names, settings).bind(fitted)
    model = reference.train(training.colours(), training.road, settings["svm"].kernel)

    for number in CHECKED if not printed else CHECKED[:2]:
        expected = reference.layers(images[number], model, filtered=filtered, printed=printed)
        layers = {
            layer.spec.name: layer.array
            for _, output in chain.run(View.of(images[number]))
            for layer in output.layers
        }
        assert list(layers) == list(expected)
        for name, array in layers.items():
            if name == "distance":
                np.testing.assert_allclose(array, expected[name], rtol=1e-6)
            else:
                np.testing.assert_array_equal(array, expected[name], err_msg=f"{number} {name}")
