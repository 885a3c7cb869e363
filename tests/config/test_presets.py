"""The presets' effective settings: whoever changes one changes what its name promises."""

import json
from pathlib import Path

import pytest

from roadeval.config.run import configure
from roadeval.config.variants import PRESETS

PINNED = Path(__file__).with_name("presets.json")


def stages(preset):
    """The chain and the settings of its stages, and the training that the preset asks for."""
    config = configure({"preset": preset})
    trained = {key: getattr(config.training, key) for key in PRESETS[preset].get("training", {})}
    return json.loads(json.dumps({**config.pipeline.as_dict(), "training": trained}))


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_s_settings_are_those_that_were_measured(preset):
    assert stages(preset) == json.loads(PINNED.read_text())[preset]
