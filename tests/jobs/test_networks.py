"""A network as a variant: in the tables, the recording, the report, a fleet and a notebook."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval.config.variants import network_variant
from roadeval.jobs.run import prepared
from roadeval.jobs.run.prepared import settings_digest
from roadeval.logs.log import open_log
from tests.e2e.commands import here
from tests.jobs.making import settings, write_log, write_module
from tests.networks.making import network, red_network
from tests.pipeline import somebody


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("networks")
    write_log(folder / "drive.mcap")
    write_log(folder / "bare.mcap", truth=False)
    red_network(folder / "red.onnx")
    return folder


def with_network(path, **values):
    """A network as a variant beside one that learns."""
    config = settings(**values).with_variants([network_variant("mine", str(path))])
    return config.override({"only": ["unfiltered", "mine"]})


def alone(path, **values):
    """A network and nothing that learns."""
    post = {"operations": [], "region": "all", "fill": False}
    return settings(chain=["net", "post"], net={"file": str(path)}, post=post, **values)


def run(drive, to, config):
    return roadeval.replay(drive, config, save=to / "out.rrd", reports=to / "reports")


@pytest.fixture(scope="module")
def once(folder, tmp_path_factory):
    to = tmp_path_factory.mktemp("once")
    return to, run(folder / "drive.mcap", to, with_network(folder / "red.onnx"))


def test_the_network_and_its_answer_stand_in_the_tables(once):
    to, _ = once
    rows = pd.read_csv(to / "reports" / "frames.csv").query("variant == 'mine'")
    assert set(rows.stage) == {"net", "post"}
    assert rows.ERR.max() < 0.01
    net, post = (rows[rows.stage == stage].ERR.to_numpy() for stage in ("net", "post"))
    assert np.array_equal(net, post)


def test_results_tell_who_ran_which_network_and_how_long_it_took(once, folder):
    _, outcome = once
    told = outcome.summary["methods"]["mine"]["net"]
    assert told["licence"] == "CC0: made by hand"
    assert told["file"] == "red.onnx"
    assert told["onnxruntime"]
    assert outcome.summary["seconds"]["mine"]["net"] > 0
    assert outcome.summary["settings"]["mine"]["net"]["sha256"] == told["sha256"]


def test_a_network_that_has_changed_since_is_refused(once, folder, tmp_path):
    to, _ = once
    text = (to / "reports" / "run.toml").read_text()
    network(tmp_path / "other.onnx")
    (tmp_path / "run.toml").write_text(
        text.replace(str(folder / "red.onnx"), str(tmp_path / "other.onnx"))
    )
    again = roadeval.load_config(tmp_path / "run.toml")
    with pytest.raises(roadeval.RoadevalError, match="another network than was asked for"):
        run(folder / "drive.mcap", tmp_path, again)


def test_what_a_recording_is_known_by_holds_the_network_and_not_its_place(folder, tmp_path):
    def known_by(path):
        with open_log(folder / "drive.mcap") as log:
            return prepared.identity(log, with_network(path).resolved())

    moved = shutil.copy(folder / "red.onnx", tmp_path / "moved.onnx")
    other = red_network(tmp_path / "other.onnx", bias=-120)
    assert known_by(folder / "red.onnx") == known_by(moved) != known_by(other)


# --- Nothing to learn -----------------------------------------------------------------------------


def test_a_network_alone_needs_no_frame_no_baseline_and_no_truth(folder, tmp_path):
    found = run(folder / "drive.mcap", tmp_path, alone(folder / "red.onnx")).summary
    assert set(found["totals"]) == {"unfiltered"}
    assert found["training"]["pixels"] == 0
    assert found["frames"]["evaluated"] == found["frames"]["labelled"]
    outcome = run(folder / "bare.mcap", tmp_path, alone(folder / "red.onnx"))
    assert outcome.summary["frames"]["trained_on"] == 0
    assert outcome.summary["training"]["source"] == "none"
    recording = roadeval.Recording(outcome.recording)
    assert recording.layer("unfiltered", "net", 0)[20, 10] == 1


def test_a_notebook_runs_a_network_on_an_image(folder):
    config = with_network(folder / "red.onnx")
    image = np.full((48, 64, 3), 30, np.uint8)
    image[24:] = 200
    result = roadeval.run_frame(image, None, config, variant="mine")
    assert [stage.stage for stage in result.stages] == ["net", "post"]
    assert result.final()[30:].all()
    assert not result.final()[:20].any()


@pytest.mark.parametrize(
    "image",
    [np.zeros((48, 64, 3)), np.zeros((3, 48, 64), np.uint8), np.zeros((48, 64, 4), np.uint8)],
    ids=lambda image: f"{image.dtype} {image.shape}",
)
def test_a_notebooks_image_has_three_channels_of_eight_bits_which_come_last(folder, image):
    config = with_network(folder / "red.onnx")
    with pytest.raises(roadeval.RoadevalError, match="not uint8"):
        roadeval.run_frame(image, None, config, variant="mine")


def test_a_fleet_replays_a_drive_again_when_the_network_has_changed(folder, tmp_path):
    from tests.e2e.test_fleet import Here

    network_file = red_network(tmp_path / "n.onnx")

    def replayed():
        config = with_network(network_file, train_frames=4)
        drives = [folder / "drive.mcap"]
        return roadeval.replay_fleet(drives, tmp_path / "fleet", config, executor=Here()).replayed

    assert [replayed(), replayed()] == [1, 0]
    red_network(network_file, bias=-120)
    assert [replayed(), replayed()] == [1, 0]


# --- Networks that go wrong -----------------------------------------------------------------------


def test_a_network_that_never_says_road_is_told_of(folder, tmp_path):
    path = red_network(tmp_path / "never.onnx", bias=-1000)
    outcome = run(folder / "drive.mcap", tmp_path, with_network(path))
    assert "mine: its final mask is road nowhere, on every frame" in outcome.warnings
    assert outcome.summary["totals"]["mine"]["post"]["FNR"] == 1


# --- A method of one's own in a run: tables, frames that it loses, models, and recordings ---------


def somebodys(name):
    return {"chain": [f"tests.pipeline.somebody:{name}", "post"]}


def line_of(text):
    """The line of the one place in the methods' file that has a text."""
    lines = Path(somebody.__file__).read_text().splitlines()
    (found,) = (number for number, line in enumerate(lines, 1) if text in line)
    return found


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


def run_settings(drive, to, **values):
    return roadeval.replay(drive, settings(**values), save=to / "o.rrd", reports=to / "reports")


def test_it_stands_in_tables_and_recording(drive, tmp_path):
    run_settings(drive, tmp_path, variants={"mine": somebodys("LEARNS")})
    rows = pd.read_csv(tmp_path / "reports" / "frames.csv").query("variant == 'mine'")
    assert set(rows.stage) == {"bright", "post"}
    assert rows.ERR.max() < 0.05
    assert roadeval.Recording(tmp_path / "o.rrd").layer("mine", "level", 15).shape


def test_a_frame_on_which_it_fails_is_lost_and_the_rest_is_scored(drive, tmp_path):
    outcome = run_settings(drive, tmp_path, variants={"mine": somebodys("fails_on_13")})
    assert outcome.losses == (
        "frame 13: variant mine: stage fails_on_13 failed: ZeroDivisionError: no road "
        f"(somebody.py:{line_of('ZeroDivisionError')})",
    )
    frames = outcome.summary["frames"]
    assert frames["evaluated"] == 14
    assert frames["skipped"]["failed in a stage"] == 1
    assert frames["evaluated"] + sum(frames["skipped"].values()) == frames["in_log"]
    assert len(outcome.tracebacks) == 1
    assert "somebody.py" in outcome.tracebacks[0]


def test_where_the_first_frames_all_fail_or_it_cannot_learn_the_run_ends(drive, tmp_path):
    variants = {"mine": somebodys("always_fails"), "fine": somebodys("lower_half")}
    with pytest.raises(roadeval.RoadevalError) as caught:
        run_settings(drive, tmp_path, variants=variants)
    assert str(caught.value) == (
        "variant mine: stage always_fails failed: KeyError: 'weights' "
        f"(somebody.py:{line_of('KeyError')}), on each of the first 10 frames (10 to 19); mend it, "
        "or leave the variant out with `only` filtered `only` unfiltered `only` fine"
    )
    assert "in always_fails" in str(caught.value.__cause__)
    with pytest.raises(roadeval.RoadevalError, match="stage unfit cannot learn: ValueError"):
        run_settings(drive, tmp_path, variants={"mine": somebodys("UNFIT")})


def test_what_it_learns_stands_in_a_model_file(drive, tmp_path):
    path, variants = tmp_path / "m.model", {"mine": somebodys("LEARNS")}
    config = settings(variants=variants, train_frames=4)
    model = roadeval.train([drive], path, config)
    outcome = run_settings(drive, tmp_path, variants=variants, model=path)
    assert outcome.summary["totals"]["mine"]["post"]["ERR"] < 0.05
    with pytest.raises(roadeval.RoadevalError, match="mine/bright is not a stage that learns"):
        roadeval.load_model(path)  # a file by itself loads nobody's code
    own = config.pipelines()["mine"].stages()
    assert roadeval.load_model(path, own).parameters["mine"] == model.parameters["mine"]


def test_results_tell_the_code_and_are_known_by_it(drive, tmp_path, monkeypatch):
    outcome = run_settings(drive, tmp_path, variants={"mine": somebodys("lower_half")})
    told = outcome.summary["methods"]["mine"]["lower_half"]
    assert told["stage"] == "tests.pipeline.somebody:lower_half"
    assert told["sha256"] == hashlib.sha256(Path(somebody.__file__).read_bytes()).hexdigest()

    def known_by(text):
        write_module(tmp_path / "changing.py", text)
        return settings_digest(settings(chain=["changing:road", "post"]), "")

    monkeypatch.syspath_prepend(tmp_path)
    one = "def road(image): return image[..., 0] > 1\n"
    other = "def road(image): return image[..., 0] > 20\n"
    assert known_by(one) == known_by(one) != known_by(other)


def test_a_recording_loads_no_code(drive, tmp_path):
    run_settings(drive, tmp_path, variants={"mine": somebodys("lower_half")})
    with pytest.raises(roadeval.RoadevalError, match="which is loaded only from a"):
        roadeval.load_config(tmp_path / "o.rrd")
    again = roadeval.load_config(tmp_path / "reports" / "run.toml")
    assert "mine" in again.pipelines()


@pytest.mark.parametrize("debug", ["0", "1"])
def test_its_traceback_is_shown_where_it_is_asked_for(debug, drive, tmp_path, monkeypatch):
    monkeypatch.setenv("ROADEVAL_DEBUG", debug)
    (tmp_path / "mine.toml").write_text('chain = ["tests.pipeline.somebody:fails_on_13", "post"]\n')
    words = ("--variant", f"mine={tmp_path / 'mine.toml'}", "--reports", tmp_path / "reports")
    run = here("replay", drive, "-q", "--record", "none", *words)
    assert run.returncode == 3
    assert "roadeval: lost: frame 13: variant mine: stage fails_on_13 failed" in run.stderr
    assert ("Traceback" in run.stderr) == (debug == "1")
