"""The configuration of a run: presets, variants, what is refused, and its file that runs again."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from roadeval import RunConfig, config_toml, configure, load_config
from roadeval.cli.options import OPTIONS
from roadeval.config.camera_file import read_camera
from roadeval.config.run import run_toml
from roadeval.config.settings import SECTIONS
from roadeval.config.tables import ConfigError
from roadeval.config.variants import PRESETS, network_variant
from roadeval.data import RESERVED
from roadeval.geometry.settings import GroundSettings
from roadeval.pipeline.stages import STAGES


def write(folder: Path, text: str) -> Path:
    path = folder / "c.toml"
    path.write_text(text)
    return path


def test_a_file_overrides_what_it_names_and_nothing_else(tmp_path):
    config = load_config(write(tmp_path, "[shadow]\nring_width = 3\n[training]\nframes = 20"))
    assert config.pipeline.settings["shadow"].ring_width == 3
    assert config.pipeline.settings["shadow"].connectivity == 8
    assert config.pipeline.settings["svm"] == RunConfig().pipeline.settings["svm"]
    assert config.training.frames == 20


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[shadow]\nring_width = 0", r"shadow\.ring_width: .* \(given: 0\)"),
        (
            "[shadow]\nring = 1",
            r"shadow\.ring: there is no such setting; did you mean ring_width\? choose",
        ),
        (
            "[shadows]\nring_width = 1",
            r"\[shadows\] is not a table here; did you mean shadow\? choose .*shadow",
        ),
        ("shadow = 3", r"shadow: must be a table"),
        ("[svm]\ngamma = nan", r"svm\.gamma: .*finite"),
        ("[svm]\nkernel = 'poly'", r"svm\.kernel: .*'rbf' or 'linear'"),
        ("[post]\nelement = 4", r"post\.element: must be odd"),
        ("[training.patch]\ntop = 0.99", r"training\.patch: top must lie above bottom"),
        ("[frames]\nevery = true", r"frames\.every: must be a whole number \(given: true\)"),
        ("[labels]\nroad = 3", r"labels\.road: must be a list \(given: 3\)"),
        (f"[topics]\nimage = ['{'x' * 999}']", r"must be text \(given: \[\"x{58}\.\.\.\)$"),
        ("[frames]\nscale = 1.5", r"frames\.scale: .*\(given: 1.5\)"),
        ("[frames]\nstart = 'noon'", "'noon' is not a time"),
        ("[labels]\nroad = [3]\nignore = [3]", "label 3 cannot mean road and ignore at once"),
        ("[labels]\nroad_colors = [[1, 2]]", r"labels\.road_colors: item 1 is too short"),
        ("[labels]\nroad = [3, -40000]", r"labels\.road: item 2 .*\(given: -40000\)"),
        ("[training.patch]\nx = 1", r"training\.patch.x: .*choose bottom, bottom_width, top"),
        ("[frames]\nstart = 2013-05-01T12:00:00", "'2013-05-01T12:00:00' is not a time"),
        ("chain = [['post']]", r"no stage \['post'\]"),
        ("ring_width = 3", "ring_width is in no table; put it below one of .*shadow"),
        ("[output]\nsave = 'g.toml'", r"output.save: g.toml does not end in .rrd"),
        ("[fleet]\nkeep = 'best:3'", r"fleet\.keep: must be 'all' or 'none'"),
        (
            "[variants.n]\nchain = ['net', 'post']\n[variants.n.net]\nroad = [3, -1]",
            r"net\.road: item 2 must be at least 0",
        ),
        (
            "[frames]\ndisturb = ['fogg:2']",
            r"no disturbance 'fogg'; did you mean fog\? choose dark",
        ),
        ("[output]\nrecord = 'some'", "choose all, masks, worst:K, every:N or none"),
        (
            "[output]\nmcap = 'm.mcap'\n[frames]\nscale = 0.5",
            "output.mcap: does not go with frames.scale",
        ),
        ("[topics.masks]\ntruth = '/x'", "variant 'truth': the name is reserved"),
        ("variants = 3", r"\[variants\] must hold a table for each variant"),
        ("[variants]\nwide = 3", r"\[variants.wide\] must be a table"),
        ("[variants.wide.svm]\nc = 0", r"\[variants.wide\]: svm\.c: "),
        ("[variants.wide.training]\nframes = 3", r"\[training\] applies to all variants"),
        ("[variants.filtered]\nchain = ['svm', 'post']", "the name is taken"),
        ("chain = ['svm', 'blur', 'post']", r"no stage 'blur'; choose .*shadow"),
        ("chain = ['svm']", "chain must end with post"),
        ("chain = ['svm', 'svm', 'post']", "a stage can occur only once"),
        ("preset = 'best'", r"preset: there is no 'best'; choose .*paper"),
        ("x = ", "cannot be read as TOML"),
        (
            "# x = ?\nx = ?  # a whole number",
            r"no value yet in the line 'x = \?  # a whole number'",
        ),
    ],
)
def test_a_bad_key_or_value_is_named(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_config(write(tmp_path, text))
    assert str(caught.value).startswith(f"{tmp_path / 'c.toml'}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        # Without a file a setting is named by table and key.
        ({"frames": {"every": 0}}, r"^`frames\.every`: must be at least 1 \(given: 0\)$"),
        ({"training": {"model": "a\0b"}}, "zero byte"),
        ({"output": {"save": "\0"}}, "zero byte"),
        ({"masks": {"m": {"path": "a\0"}}}, "zero byte|must name a log"),
        ({"labels": {"road": ["a\0"]}}, r"^`labels\.road`: holds a zero byte"),
        ({"labels": {"road": ["\udcff"]}}, r"^`labels\.road`: its bytes are not UTF-8"),
        ({"output": {"labels": {"\udcff": "a"}}}, r"^`output\.labels\.\\udcff`: its bytes"),
        ({"cameras": [{}]}, r"^\[\[cameras\]\]: image must name its topic$"),
        ({"cameras": [{"name": "left"}]}, r"^\[\[cameras\]\] left: image must name its topic$"),
        *(({"variants": {name: {}}}, "reserved") for name in sorted(RESERVED)),
        *(
            ({"variants": {name: {}}}, "letters, digits")
            for name in ("a/b", "", "ä", "a b", "-", "../x")
        ),
        (
            {"masks": {"net": {"path": "a", "thresold": 1}}},
            r"there is no such setting; did you mean threshold\? choose decide, first",
        ),
        ({"masks": {"net": {"path": "a", "threshold": 2}}}, "must be at most 1"),
        (
            {"masks": {"net": {"path": "a", "threshold": 0.5, "labels": {"road": [3]}}}},
            "threshold is for confidence",
        ),
        (
            {"masks": {"net": {"path": "a", "images": "b", "first": 1}}},
            "with images labels are paired by name",
        ),
    ],
)
def test_what_cannot_be_set_is_refused(tables, message):
    with pytest.raises(ConfigError, match=message):
        configure(tables)


@pytest.mark.parametrize(
    ("text", "start"),
    [("2", "2"), ("2.5", "2.5"), ("2013-05-01T12:00:00Z", "2013-05-01T12:00:00Z")],
)
def test_a_time_may_be_a_number_or_a_date(tmp_path, text, start):
    assert load_config(write(tmp_path, f"[frames]\nstart = {text}")).frames.start == start


def test_the_two_variants_differ_by_the_filter_alone():
    filtered, unfiltered = RunConfig().variants()
    assert (filtered.name, unfiltered.name) == ("filtered", "unfiltered")
    assert set(filtered.pipeline.chain) - set(unfiltered.pipeline.chain) == {"shadow"}
    assert filtered.pipeline.without_filter() == unfiltered.pipeline


@pytest.mark.parametrize("chain", [["post"], ["shadow", "post"], ["exposure", "post"]])
def test_a_chain_without_a_mask_cannot_run(chain):
    wrong = "makes a road mask for post"
    with pytest.raises(ConfigError, match=wrong):
        configure({"chain": chain}).resolved()
    own = {"variants": {"own": {"chain": chain}}}
    with pytest.raises(ConfigError, match=f"variant own: .*{wrong}"):
        configure(own).resolved()


def test_no_stage_is_called_like_a_table_of_the_run():
    assert not STAGES.keys() & {*SECTIONS, "chain", "preset", "variants"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("size = [8, 8]\n", "file must name the network"),
        ('file = "n.onnx"\nsise = [8, 8]\n', r"net\.sise: there is no such setting"),
        ('file = "n.onnx"\nthreshold = 0.3\ndecide = "trained"\n', "threshold has no effect"),
    ],
)
def test_settings_of_a_network_name_its_file_and_nothing_unknown(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        network_variant("mine", str(write(tmp_path, text)))
    assert str(tmp_path / "c.toml") in str(caught.value)


@pytest.mark.parametrize("name", ["truth", "shadow"])
@pytest.mark.parametrize("taken", ["", "/labels"])
def test_an_empty_topic_is_that_of_every_camera_but_of_those_that_name_one(name, taken):
    named = {name: taken} if taken else {}
    cameras = [{"image": f"/{side}", **named} for side in ("left", "right")]
    config = configure({"topics": {name: ""}, "cameras": cameras})
    assert {getattr(camera.topics, name) for camera in config.by_camera().values()} == {taken}


def test_masks_are_those_of_the_drive():
    config = configure({"masks": {"net": {"path": "net/{drive}", "threshold": 0.4}}})
    assert config.for_drive("logs/a.mcap").masks["net"].path == "net/a"
    masks = config.of_drive({"masks": {"net": {"path": "elsewhere"}}}).masks["net"]
    assert (masks.path, masks.threshold) == ("elsewhere", 0.4)


def test_what_is_no_drive_s_and_masks_that_lie_nowhere_are_refused_of_a_drive():
    with pytest.raises(ConfigError, match=r"\[training\] is not a table here; choose frames,"):
        configure().of_drive({"training": {}})
    with pytest.raises(ConfigError, match=r"\[masks.net\] has no path"):
        configure({"masks": {"net": {"threshold": 0.5}}}).for_drive("a.mcap")


OTHER = {
    "output.save": "out.rrd",
    "output.reports": "tables",
    "output.mcap": "masks.mcap",
    "output.record": "worst:7",
    "output.focus": "unfiltered",
    "output.labels": {"branch": 'main, "as is"', "commit": "1a2b"},
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
    "frames.disturb": ["fog:2", "exposure:-1"],
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


@pytest.mark.parametrize("preset", [*PRESETS, "tuned"])
def test_every_preset_and_a_tuned_network_read_back_from_the_file_of_a_run(preset, tmp_path):
    if preset == "tuned":
        (tmp_path / "net.toml").write_text('file = "n.onnx"\nsize = [64, 48]\nroad = [1, 3]\n')
        config = RunConfig().with_variants([network_variant("mine", str(tmp_path / "net.toml"))])
        config = config.with_tuned(["mine"])
    else:
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


# --- Files of calibration tools as the camera of a run --------------------------------------------


OST = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [560.5, 0, 318., 0.0, 561.25, 241, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.3, 0.1, 1e-05, -0.002, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [500.0, 0.0, 318.0, 0.0, 0.0, 500.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
FRONT: dict[str, Any] = {
    "cam_overlaps": [1],
    "camera_model": "pinhole",
    "distortion_coeffs": [-0.01, 0.002, 0.0, 1e-05],
    "distortion_model": "equidistant",
    "intrinsics": [460.0, 461.0, 380.0, 250.0],
    "resolution": [752, 480],
    "rostopic": "/cam0/image_raw",
}
REAR = {**FRONT, "intrinsics": [400.0, 400.0, 370.0, 240.0], "rostopic": "/cam1/image_raw"}


def given(folder: Path, text: str, topic: str | None = None) -> GroundSettings:
    path = folder / "camera.yaml"
    path.write_text(text)
    return configure({"ground": read_camera(path, topic)}).ground


def test_the_file_of_ros_is_read(tmp_path: Path):
    assert given(tmp_path, f"{OST}height: 1.4\npitch: 3\n") == GroundSettings(
        height=1.4,
        pitch=3.0,
        size=(640, 480),
        focal=(560.5, 561.25),
        centre=(318.0, 241.0),
        model="plumb_bob",
        distortion=(-0.3, 0.1, 1e-5, -0.002, 0.0),
    )


def test_the_file_of_kalibr_is_read(tmp_path: Path):
    text = yaml.dump({"cam0": FRONT})
    assert given(tmp_path, text) == GroundSettings(
        size=(752, 480),
        focal=(460.0, 461.0),
        centre=(380.0, 250.0),
        model="equidistant",
        distortion=(-0.01, 0.002, 0.0, 1e-5),
    )


def test_of_several_cameras_the_topic_of_the_images_tells_which(tmp_path: Path):
    text = yaml.dump({"cam0": FRONT}) + yaml.dump({"cam1": REAR})
    assert given(tmp_path, text, "/cam1/image_raw/compressed").focal == (400.0, 400.0)
    with pytest.raises(ConfigError, match=r"several cameras, cam0 \(/cam0/image_raw\), cam1"):
        given(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (yaml.dump({"cam0": {**FRONT, "camera_model": "omni"}}), "cam0 has the camera model omni"),
        (OST.replace("-0.3", ".nan"), "ground.distortion: item 1"),
        (OST.replace("560.5", "-1"), "ground.focal: item 1"),
        (OST.replace("560.5", "fx"), "no camera as ROS's camera_calibration"),
        (OST.replace("image_width: 640", "image_width: [640]"), "ground.size: item 1"),
        (OST.replace("  data: [560.5", "  dates: [560.5"), "no camera as ROS's camera_calibration"),
        (yaml.dump({"cam0": {**FRONT, "intrinsics": []}}), "no camera as ROS's"),
        ("- 1\n- 2\n", "no camera as ROS's camera_calibration"),
        ("", "no camera as ROS's camera_calibration"),
        ("a: &x [1, 1]\nb: [*x, *x]\n", "it has aliases"),
        ("[" * 60_000, "cannot be read as YAML: it nests more than 32"),
        (f"{OST}#{'x' * 200_000}", "at most 131,072 are read"),
        ("!!python/object/apply:os.system ['true']", "cannot be read as YAML"),
        ("a: [1\nb: }", "cannot be read as YAML"),
    ],
)
def test_what_is_no_camera_is_refused_in_one_line(tmp_path: Path, text: str, message: str):
    with pytest.raises(ConfigError) as error:
        given(tmp_path, text)
    assert message in str(error.value).replace("`", "")
    assert "\n" not in str(error.value)
