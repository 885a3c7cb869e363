"""One configuration, validated: presets, TOML, variants."""

from pathlib import Path

import pytest

from roadeval.config import Config, ConfigError, load_config, preset, variants_of
from roadeval.data import RESERVED


def write(folder: Path, text: str) -> Path:
    path = folder / "c.toml"
    path.write_text(text)
    return path


def test_paper_is_the_default():
    assert Config() == preset("paper")


def test_printed_takes_the_misprints_literally():
    printed = preset("printed").stages
    assert printed["shadow"].threshold == "printed"
    assert printed["shadow"].inclusive
    assert printed["shadow"].statistic == "printed"
    assert printed["shadow"].colour_space == "hsi"
    assert printed["svm"].kernel == "linear"


def test_an_unknown_preset_lists_those_there_are():
    with pytest.raises(ConfigError, match=r"no preset 'best'; choose .*paper, printed"):
        preset("best")


def test_a_file_overrides_what_it_names_and_nothing_else(tmp_path):
    config = load_config(write(tmp_path, "[shadow]\nring_width = 3\n[training]\nframes = 20"))
    assert config.stages["shadow"].ring_width == 3
    assert config.stages["shadow"].connectivity == 8
    assert config.stages["svm"] == Config().stages["svm"]
    assert config.training.frames == 20


def test_a_file_may_start_from_a_preset(tmp_path):
    config = load_config(write(tmp_path, 'preset = "printed"\n[svm]\nc = 3'))
    assert config.stages["svm"].kernel == "linear"
    assert config.stages["svm"].c == 3


def test_the_caller_s_preset_is_used_where_the_file_names_none(tmp_path):
    config = load_config(write(tmp_path, "[svm]\nc = 3"), base="printed")
    assert config.stages["svm"].kernel == "linear"


def test_a_nested_table_overrides_a_part(tmp_path):
    config = load_config(write(tmp_path, "[post.patch]\ntop = 0.6"))
    assert config.stages["post"].patch.top == 0.6
    assert config.stages["post"].patch.bottom == Config().stages["post"].patch.bottom


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[shadow]\nring_width = 0", r"\[shadow\] ring_width: .* \(given: 0\)"),
        ("[shadow]\nring = 1", r"\[shadow\] ring: there is no such setting; choose .*ring_width"),
        ("[shadows]\nring_width = 1", r"\[shadows\] is no table here; choose .*shadow"),
        ("shadow = 3", r"\[shadow\] must be a table"),
        ("[svm]\ngamma = nan", r"\[svm\] gamma: .*finite"),
        ("[svm]\nkernel = 'poly'", r"\[svm\] kernel: .*'rbf' or 'linear'"),
        ("[post]\nelement = 4", r"\[post\] element: must be odd"),
        ("[post.patch]\ntop = 0.99", r"\[post\] patch: top must lie above bottom"),
        ("[training]\nframes = 'ten'", r"\[training\] frames: .*integer"),
        ("[evaluation]\nwindow = 0", r"\[evaluation\] window: "),
        ("chain = ['svm', 'blur', 'post']", r"no stage 'blur'; choose .*shadow"),
        ("chain = ['svm']", "chain must end with post"),
        ("chain = ['svm', 'svm', 'post']", "a stage can occur only once"),
        ("chain = 'svm'", "chain must be a list"),
        ("preset = 'best'", r"preset: there is no 'best'; choose .*paper"),
        ("preset = 3", "preset: there is no 3"),
        ("x = ", "not valid TOML"),
    ],
)
def test_a_bad_key_or_value_is_named(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_config(write(tmp_path, text))
    assert str(caught.value).startswith(str(tmp_path / "c.toml"))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match="no such configuration file"):
        load_config(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_one_line(tmp_path):
    (tmp_path / "c.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path / "c.toml")


def test_a_chain_may_leave_stages_out(tmp_path):
    config = load_config(write(tmp_path, 'chain = ["svm", "post"]'))
    assert config.chain == ("svm", "post")
    assert not config.has_filter


def test_the_two_variants_differ_by_the_filter_alone():
    filtered, unfiltered = variants_of(Config(), {})
    assert (filtered.name, unfiltered.name) == ("filtered", "unfiltered")
    assert set(filtered.config.chain) - set(unfiltered.config.chain) == {"shadow"}
    assert filtered.config.without_filter() == unfiltered.config


def test_a_chain_without_a_filter_is_one_variant():
    assert [v.name for v in variants_of(Config().without_filter(), {})] == ["unfiltered"]


def test_extra_variants_come_last():
    named = variants_of(Config(), {"wide": Config()})
    assert [v.name for v in named] == ["filtered", "unfiltered", "wide"]


@pytest.mark.parametrize("name", sorted(RESERVED))
def test_reserved_names_are_refused(name):
    with pytest.raises(ConfigError, match="reserved"):
        variants_of(Config(), {name: Config()})


@pytest.mark.parametrize("name", ["a/b", "", "ä", "a b", "-", "../x"])
def test_names_that_are_no_plain_word_are_refused(name):
    with pytest.raises(ConfigError, match="letters, digits"):
        variants_of(Config(), {name: Config()})


def test_a_taken_name_is_refused():
    with pytest.raises(ConfigError, match="taken"):
        variants_of(Config(), {"filtered": Config()})


def test_a_layout_lists_layers_and_masks_in_order():
    layout = variants_of(Config(), {})[0].layout()
    assert layout.stages == ("similarity", "svm", "post")
    assert [spec.name for spec in layout.layers] == [
        *("ndi", "shadow", "rings", "compensated"),
        *("distance", "similarity", "svm", "post", "boundary"),
    ]


def test_every_setting_reads_back_from_its_plain_form(tmp_path):
    import json
    import tomllib

    plain = json.loads(json.dumps(preset("printed").as_dict()))
    assert plain["shadow"]["colour_space"] == "hsi"
    assert tomllib.loads('[svm]\nkernel = "linear"')["svm"]["kernel"] == plain["svm"]["kernel"]
