"""What cannot be asked of a training."""

import pytest

from roadeval.config import ConfigError, configure
from roadeval.training import TrainingSettings


def test_the_settings_of_each_seed_are_those_of_one_training():
    each = list(TrainingSettings(seed=2, seeds=3, frames=4).by_seed())
    assert each == [TrainingSettings(seed=seed, frames=4) for seed in (2, 3, 4)]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"seeds": 2, "model": "city.model"}, "`training.model` is trained already"),
        ({"seeds": 2, "seed": 1_000_000_000}, "no seed may be above 1000000000"),
        ({"seeds": 0}, "must be at least 1"),
    ],
)
def test_seeds_that_cannot_be_are_refused(given, said):
    with pytest.raises(ConfigError, match=said):
        configure({"training": given})


def test_a_model_file_may_be_used_and_a_single_seed_be_the_last():
    assert TrainingSettings(model="city.model").seeds == 1
    assert TrainingSettings(seed=1_000_000_000).seeds == 1
