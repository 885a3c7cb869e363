"""What the benchmark of disturbances measures with: its network, and its two tables."""

import numpy as np
import onnxruntime
import pytest

from benchmarks.disturbances import HEIGHT, TITLES, WIDTH, falls, table, write_network
from roadeval.data import Frame
from roadeval.evaluation.score.degradation import Degradation
from tests.evaluation.making import a_difference
from tests.fixtures.drives import scene


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")  # a rough network is enough
def test_its_network_finds_the_road_that_it_has_learnt(tmp_path):
    frames = [Frame(n, n, n, scene(n)[0], b"", truth=scene(n)[1]) for n in range(0, 12, 4)]
    net = onnxruntime.InferenceSession(write_network(tmp_path / "net.onnx", frames))
    image, road = scene(6)  # of 96x72, as the network takes
    levels = image.transpose(2, 0, 1)[None] / np.float32(255)
    (said,) = net.run(None, {"image": levels})
    assert said.shape == (1, 1, HEIGHT, WIDTH)
    assert ((said[0, 0] > 0.5) != (road == 1)).mean() < 0.1


def test_its_tables_have_every_method_and_say_where_strength_does_less_harm():
    changes = {
        name: {
            f"fog-{strength}": Degradation("fog", strength, error, 0.02, a_difference(1))
            for strength, error in ((1, 0.05), (2, 0.04 if name == "robust" else 0.06))
        }
        for name in TITLES
    }
    lines = [*table(changes)]
    assert lines[2] == "| undisturbed | 2.0 | 2.0 | 2.0 | 2.0 | 2.0 |"
    assert lines[4] == "| `fog:2` | 6.0 | 6.0 | 4.0 | 6.0 | 6.0 |"
    assert [*falls(changes)] == ["robust: fog:1 5.00 %, fog:2 4.00 %"]
