"""A run's configuration as a file that makes the same run again, and as a documented one."""

from itertools import pairwise

import pytest

from roadeval.cli.options import OPTIONS
from roadeval.config.run import RunConfig, config_toml, configure, load_config, run_toml
from roadeval.config.tables import ConfigError
from roadeval.config.variants import PRESETS, network_variant

OTHER = {
    "output.save": "out.rrd",
    "output.reports": "tables",
    "output.mcap": "masks.mcap",
    "output.record": "worst:7",
    "preset": "gated",
    "variants": {"wide": {"preset": "printed", "shadow": {"ring_width": 3}}},
    "cameras": [{"image": "/left/image", "name": "left", "masks": {"net": "/net"}}],
    "training.model": "city.model",
    "training.adapt": True,
    "training.frames": 4,
    "training.placement": "spread",
    "training.gap": 2,
    "only": ["unfiltered"],
    "truth.path": "labels/{drive}",
    "truth.pair": "stamp",
    "truth.first": 1,
    "truth.names": "left_*",
    "truth.skip_roadless": True,
    "truth.images": "frames/{drive}",
    "topics.image": "/left/image",
    "topics.frame_id": "left",
    "topics.truth": '/a "quoted" topic',
    "topics.shadow": "/shadow",
    "topics.masks": {"net": "/net/mask"},
    "topics.sync_tolerance_ms": 2.5,
    "topics.sync_offset_ms": -37_000.0,
    "topics.resize_truth": True,
    "labels.road": [3, "lane marking"],
    "labels.ignore": [11],
    "labels.road_colors": [[128, 64, 128]],
    "labels.ignore_colors": [[0, 0, 0]],
    "masks": {"net": {"path": "net/{drive}", "threshold": 0.4}},
    "frames.start": "2013-05-01T12:00:00Z",
    "frames.end": "90",
    "frames.every": 3,
    "frames.labelled": True,
    "frames.max_frames": 50,
    "frames.scale": 0.5,
    "frames.max_pixels": 1_000_000,
    "frames.unturned": True,
    "frames.white": 4095.0,
    "frames.full_range": True,
    "ground": {"height": 1.4, "pitch": 1.2, "focal": [485.0]},
    "run.jobs": 1,
    "run.patience_s": 5.0,
    "fleet.folds": 5,
    "fleet.keep": "all",
    "fleet.scheduler": "tcp://host:8786",
}
"""A value other than the default for every option of the command line."""

NEEDS = {
    "training.adapt": {"training": {"model": "city.model"}},
    "labels.ignore": {"labels": {"road": [3]}},
    "labels.ignore_colors": {"labels": {"road_colors": [[1, 1, 1]]}},
}


def tables(setting: str) -> dict:
    table, _, key = setting.partition(".")
    made = {table: {key: OTHER[setting]} if key else OTHER[setting]}
    for name, more in NEEDS.get(setting, {}).items():
        made[name] = {**more, **made.get(name, {})}
    return made


def test_every_option_is_tried_here():
    # In a file a network is a variant like others, and so is a tuned one.
    options = {option.setting for option in OPTIONS} - {"config", "nets", "tunes"}
    assert OTHER.keys() == options | {"topics.image"}  # of which `cameras` has one or more


@pytest.mark.parametrize("setting", OTHER)
@pytest.mark.parametrize("write", [lambda c: run_toml(c, "drive", "1.0"), config_toml])
def test_the_file_of_a_run_gives_the_same_configuration_again(setting, write, tmp_path):
    config = configure(tables(setting))
    assert config != RunConfig()
    (tmp_path / "run.toml").write_text(write(config), encoding="utf-8")
    assert load_config(tmp_path / "run.toml") == config


@pytest.mark.parametrize("write", [lambda c: run_toml(c, "drive", "1.0"), config_toml])
def test_a_tuned_network_reads_back_from_the_file_of_a_run(write, tmp_path):
    (tmp_path / "net.toml").write_text('file = "n.onnx"\nsize = [64, 48]\nroad = [1, 3]\n')
    config = RunConfig().with_variants([network_variant("mine", str(tmp_path / "net.toml"))])
    config = config.with_tuned(["mine"])
    (tmp_path / "run.toml").write_text(write(config), encoding="utf-8")
    assert load_config(tmp_path / "run.toml") == config


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_reads_back_from_its_file(preset, tmp_path):
    config = configure({"preset": preset})
    for text in (run_toml(config, "d", "1"), config_toml(config)):
        (tmp_path / "run.toml").write_text(text)
        assert load_config(tmp_path / "run.toml") == config


def test_every_setting_is_documented_with_its_range():
    text = config_toml(configure({"variants": {"gated": {"preset": "gated"}}}))
    lines = text.splitlines()
    undocumented = [
        line
        for before, line in pairwise(lines)
        if (" = " in line or line.endswith(" =")) and not before.startswith("#")
    ]
    assert undocumented == ['preset = "gated"']
    assert "Default: one per CPU core. At least 1, at most 1000.\n# jobs =\n" in text
    assert "One of auto, truth, patch.\nsource" in text.replace("\n# ", " ")
    assert "Above 0, at most 1.\nscale = 1.0\n" in text
    assert "``" not in text
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize("table", ["", "[variants.theirs]\n"])
def test_a_file_that_the_user_has_not_named_loads_no_code(tmp_path, table):
    path = tmp_path / "run.toml"
    path.write_text(f'{table}chain = ["tests.pipeline.somebody:lower_half", "post"]\n')
    assert load_config(path)
    with pytest.raises(ConfigError, match=r"run.toml: its chain names code, tests\.pipeline\.some"):
        load_config(path, trusted=False)
