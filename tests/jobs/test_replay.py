"""The main job, on a small log of our own: outputs, identity, training of several."""

import shutil
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval import RoadevalError, load_config
from roadeval.jobs.run import prepared
from roadeval.jobs.run import replay as replaying
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from roadeval.pipeline.paper.shadow import NDI_CODES, otsu_threshold
from roadeval.report import figures as drawn
from roadeval.results import schema
from roadeval.results.facts import Origin
from roadeval.results.folder import ResultsFolder
from tests.fixtures.make import make
from tests.jobs.making import FRAMES, NS, settings, write_log

DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"
TABLES = tuple(n for n in schema.OF_A_DRIVE if n not in ("probabilities", "classes"))
"""Those of runs in which nothing says how probable road is."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "small.mcap", net=True)


def run(drive: Path, folder: Path, **options):
    save = None if options.get("record") == "none" else folder / "out.rrd"
    config = settings(**{"ground": {"height": 1.4, "pitch": 3, "fov": 60}, **options})
    return roadeval.replay(drive, config, save=save, reports=folder / "reports")


def frames_of(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "reports" / "frames.csv")


@pytest.fixture(scope="module")
def once(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("once")
    return folder, run(drive, folder, jobs=2, disturb=["noise:1", "fog:2"])


def test_training_frames_of_the_drive_itself_are_left_out_and_warned_of(drive, tmp_path):
    model = roadeval.train([drive], tmp_path / "m.model", settings(train_frames=5))
    outcome = run(drive, tmp_path, model=tmp_path / "m.model")
    assert outcome.summary["frames"]["trained_on"] == len(model.digests) == 5
    assert outcome.summary["frames"]["evaluated"] == 20
    warned = "5 of the model's 5 training frames lie in this drive; their"
    assert any(warned in text for text in outcome.summary["warnings"])


def test_folders_are_made_and_a_run_that_is_refused_leaves_nothing(drive, tmp_path):
    (tmp_path / "new").mkdir()
    names = {"save": "o.rrd", "reports": "reports", "mcap": "new/m.mcap"}
    outputs = {option: tmp_path / name for option, name in names.items()}
    with pytest.raises(RoadevalError, match="training"):
        roadeval.replay(drive, settings(max_frames=3), **outputs)
    assert [path.name for path in tmp_path.rglob("*")] == ["new"]
    roadeval.replay(drive, settings(max_frames=14), **outputs)
    assert (tmp_path / "new" / "m.mcap").exists()


def test_results_become_a_log_with_the_images_own_times(drive, tmp_path):
    roadeval.replay(drive, save=tmp_path / "o.rrd", reports=tmp_path, mcap=tmp_path / "side.mcap")
    scored = pd.read_csv(tmp_path / "frames.csv").query("variant == 'filtered' and stage == 'post'")
    topics = TopicSettings(image="/roadeval/filtered/post", truth="")
    with open_log(tmp_path / "side.mcap", LogConfig(topics=topics)) as side:
        counts = {topic.name: topic.count for topic in side.topics}
        masks = side.select()
        stamps = [logged.stamp_ns for logged in side.frames(masks)]
    assert counts["/roadeval/unfiltered/svm"] == FRAMES
    assert counts["/roadeval/metrics/filtered/post"] == len(scored)
    assert stamps == [(number + 1) * NS for number in range(FRAMES)]


def test_what_the_log_lost_is_told(tmp_path):
    outcome = run(make("broken/zero_hole.mcap", tmp_path), tmp_path)
    assert outcome.summary["frames"]["read"] == 38
    assert "a chunk that the summary lists is not there" in outcome.losses[0]
    assert outcome.summary["losses"] == list(outcome.losses)


def test_a_broken_frame_costs_itself_alone_is_named_and_is_no_neighbour(tmp_path):
    log = write_log(tmp_path / "hurt.mcap", broken=13)
    outcome = run(log, tmp_path)
    assert outcome.summary["frames"]["decoded"] == 25
    assert outcome.summary["frames"]["evaluated"] == 14
    assert "13" in outcome.losses[0]
    assert 13 not in set(frames_of(tmp_path).frame)
    assert outcome.summary["beyond"]["filtered"]["pairs"] == 2 + 5 + 4


def test_without_a_recording_the_tables_are_the_same(drive, once, tmp_path):
    outcome = run(drive, tmp_path, record="none")
    assert outcome.recording is None
    assert not (tmp_path / "out.rrd").exists()
    frames = (tmp_path / "reports" / "frames.csv").read_bytes()
    assert frames == (once[0] / "reports" / "frames.csv").read_bytes()


SPARE = sorted({*TABLES} - {"frames", "windows"})
"""Tables that results can do without."""


@pytest.mark.sweep
def test_tables_that_are_left_out_cost_a_report_their_parts_alone(drive, once, tmp_path):
    folder, _ = once
    run(drive, tmp_path, disturb=["noise:1", "fog:2"], output={"without": SPARE, "packed": True})
    files = {path.name for path in (tmp_path / "reports").glob("*.csv*")}
    assert files == {"frames.csv.gz", "windows.csv.gz"}
    for result, ending in ((tmp_path / "out.rrd", "html"), (tmp_path / "reports", "pdf")):
        pd.testing.assert_frame_equal(
            roadeval.Result(result).table("frames"),
            roadeval.Result(folder / "reports").table("frames"),
        )
        assert all(roadeval.Result(result).table(name).empty for name in SPARE)
        roadeval.write_report(result, tmp_path / f"report.{ending}")
    roadeval.compare([tmp_path / "reports", folder / "reports"])


def test_a_table_that_results_cannot_do_without_is_not_left_out(drive):
    for name in ("frames", "windows", "scores", "x"):
        with pytest.raises(RoadevalError, match=r"^`output\.without`: must be some of regions, "):
            settings(output={"without": ["heat", name]})


def test_time_commit_and_labels_are_in_the_summary_and_not_in_the_recording(
    drive, once, tmp_path, monkeypatch
):
    monkeypatch.setattr(replaying, "current_commit", lambda: ("1a2b", True))
    config = settings(max_frames=14).override({"output": {"labels": {"branch": "main"}}})
    begun = time.time_ns()
    done = roadeval.replay(drive, config, save=tmp_path / "o.rrd", reports=tmp_path / "o")
    origin = roadeval.Result(tmp_path / "o").facts.origin
    assert begun < origin.made_ns < time.time_ns()
    assert origin == Origin(origin.made_ns, "1a2b", dirty=True, labels={"branch": "main"})
    assert done.facts.origin == origin
    recorded = roadeval.Result(tmp_path / "o.rrd").facts
    assert (recorded.origin, recorded.run["output"]["labels"]) == (None, {})
    assert load_config(tmp_path / "o" / "run.toml").output.labels == origin.labels


@pytest.mark.parametrize(
    ("rule", "pictured", "layers"),
    [
        ("all", range(26), {"ndi", "post"}),
        ("masks", range(26), {"post"}),
        ("every:7", range(0, 26, 7), {"ndi", "post"}),
    ],
)
def test_pictures_are_recorded_by_the_rule(drive, tmp_path, rule, pictured, layers):
    recording = roadeval.Recording(run(drive, tmp_path, record=rule).recording)
    assert list(recording.frame_numbers) == list(pictured)
    assert len(recording.frames.frame.unique()) == 15
    for layer in ("ndi", "post"):
        if layer in layers:
            recording.layer("filtered", layer, 14)
        else:
            with pytest.raises(RoadevalError):
                recording.layer("filtered", layer, 14)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A recording of the demo's first frames, of which some are evaluated."""
    save = tmp_path_factory.mktemp("demo") / "out.rrd"
    done = roadeval.replay(
        DEMO, settings(max_frames=14), save=save, reports=save.parent / "reports"
    )
    return roadeval.Recording(done.recording)


def test_the_demos_shadow_mask_follows_from_its_image_and_the_recorded_threshold(demo):
    thresholds = demo.scalars("/facts/filtered/shadow/threshold")
    for frame in demo.frame_numbers:
        image = demo.image(frame)
        code = (thresholds[frame] + 1) * 127.5
        assert code == pytest.approx(round(code), abs=1e-9)
        codes = NDI_CODES[image.sum(axis=2, dtype=int), image.min(axis=2)]
        assert otsu_threshold(np.bincount(codes.ravel(), minlength=256)) == round(code)
        shadow = demo.layer("filtered", "shadow", frame)
        np.testing.assert_array_equal(shadow, codes > round(code))
        ndi = (demo.layer("filtered", "ndi", frame) + 1) * 127.5
        assert 0.1 < np.abs(ndi - codes).mean() < 3


@pytest.fixture
def earlier(once, tmp_path):
    """A folder with the outputs of an earlier run, and what it holds."""
    shutil.copytree(once[0], tmp_path, dirs_exist_ok=True)
    return tmp_path, contents(tmp_path)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_where_figures_cannot_be_written_the_earlier_outputs_stay_all_three(
    drive, earlier, monkeypatch
):
    """A disk that is full at the very last files costs neither folder nor recording nor log."""
    folder, before = earlier
    (folder / "out.mcap").write_text("an earlier log")

    def fail(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(drawn, "write_figures", fail)
    with pytest.raises(RoadevalError, match=r"reports: cannot be written: No space") as caught:
        roadeval.replay(
            drive,
            settings(max_frames=12),
            save=folder / "out.rrd",
            reports=folder / "reports",
            mcap=folder / "out.mcap",
        )
    (left,) = folder.glob("out.*.partial.rrd")
    assert caught.value.__notes__ == [f"the partial recording is {left}"]
    assert roadeval.Recording(left).complete
    left.unlink()
    assert contents(folder) == before | {"out.mcap": b"an earlier log"}


def test_a_run_that_fails_leaves_an_earlier_one_s_partial_recording(drive, tmp_path):
    left = tmp_path / "out.0123abcd.partial.rrd"
    left.write_text("some frames")
    with pytest.raises(RoadevalError, match="no frame in this range"):
        run(drive, tmp_path, start="1000")
    assert [path.name for path in tmp_path.iterdir()] == [left.name]


def test_a_variant_whose_preset_trains_otherwise_is_trained_like_the_rest_and_warned_of():
    robust = {"variants": {"v": {"preset": "robust"}}}
    (pixels, most) = roadeval.configure(robust).ignored_settings()
    assert "v: preset robust asks for training.pixels_per_class = 1000" in pixels
    assert "training.max_pixels = 50000" in most
    assert roadeval.configure({"preset": "robust"} | robust).ignored_settings() == ()


@pytest.mark.parametrize("table", TABLES)
def test_a_table_is_the_same_in_the_folder_and_in_the_recording_bit_by_bit(once, table):
    folder, outcome = once
    recording, results = roadeval.Recording(outcome.recording), ResultsFolder(folder / "reports")
    written = results.table(table)
    assert len(written)
    pd.testing.assert_frame_equal(recording.table(table), written, check_exact=True)


def test_a_recording_s_own_configuration_makes_the_run_again(once, drive, tmp_path):
    folder, outcome = once
    again = roadeval.load_config(outcome.recording)
    assert again.as_dict()["output"]["save"] is None
    roadeval.replay(drive, again, save=tmp_path / "o.rrd", reports=tmp_path)
    for table in TABLES:
        theirs = (folder / "reports" / f"{table}.csv").read_bytes()
        assert (tmp_path / f"{table}.csv").read_bytes() == theirs


def test_flicker_is_counted_from_each_evaluated_frame_to_the_next_one_read(once, drive, tmp_path):
    """Frame 20 has no truth, so neither 19 to 20 nor 20 to 21 is a pair."""
    _, outcome = once
    assert outcome.summary["beyond"]["filtered"]["pairs"] == 9 + 4
    every = run(drive, tmp_path, every=2, train_frames=4).summary
    assert every["beyond"]["filtered"]["pairs"] == (6 - 1) + (2 - 1)


def test_a_scale_reduces_images_truth_and_recording_alike(drive, tmp_path, once):
    outcome = run(drive, tmp_path, scale=0.5, masks={"net": "/net/road_mask_prediction"})
    full, small = once[1].summary["drive"], outcome.summary["drive"]
    assert (small["width"], small["height"]) == (full["width"] // 2, full["height"] // 2)
    assert outcome.summary["run"]["frames"]["scale"] == 0.5
    frames = frames_of(tmp_path)
    assert set(frames["N"]) == {small["width"] * small["height"]}
    # The log's own masks are reduced like the truth that they are copies of.
    assert set(frames[frames["variant"] == "net"]["ERR"]) == {0.0}
    recording = roadeval.Recording(outcome.recording)
    number = int(frames["frame"].iloc[0])
    assert recording.image(number).shape == (small["height"], small["width"], 3)
    assert recording.layer("filtered", "post", number).shape == (small["height"], small["width"])


def test_damage_that_costs_no_message_is_a_warning(tmp_path):
    path = write_log(tmp_path / "twice.mcap")
    path.write_bytes(2 * path.read_bytes())
    found = roadeval.replay(path, settings(jobs=1), save=tmp_path / "o.rrd", reports=tmp_path / "o")
    assert any("another log begins here" in each for each in found.warnings)
    assert not found.losses


@pytest.fixture(scope="module")
def a_log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("a") / "drive.mcap")


def of(path, **values):
    with open_log(path) as log:
        return prepared.identity(log, settings(**values))


@pytest.mark.parametrize(
    "values",
    [
        {"every": 2},
        {"record": "masks"},
        {"preset": "robust"},
        {"shadow": {"ring_width": 3}},
        {"variants": {"wide": {"preset": "paper"}}},
        {"train_frames": 5},
        {"truth": "/truth/road"},
        {"output": {"without": ["heat"]}},
    ],
)
def test_two_configurations_of_one_drive_differ(values, a_log):
    assert of(a_log) != of(a_log, **values)


def test_two_models_differ_and_one_is_the_same_wherever_it_lies(a_log, tmp_path):
    one, moved, other = tmp_path / "1.model", tmp_path / "2.model", tmp_path / "3.model"
    roadeval.train([a_log], one, settings(train_frames=4))
    shutil.copy(one, moved)
    roadeval.train([a_log], other, settings(train_frames=5))
    assert of(a_log, model=one) == of(a_log, model=moved) != of(a_log, model=other)
    assert of(a_log, model=one) != of(a_log)


def test_other_frames_under_the_same_name_and_another_version_differ_and_other_places_do_not(
    a_log, tmp_path, monkeypatch
):
    before, copy = of(a_log), shutil.copy(a_log, tmp_path / "drive.mcap")
    places = {"output": {"save": "x.rrd", "reports": "y", "mcap": "z.mcap", "packed": True}}
    assert of(copy, jobs=3, **places) == before
    assert of(write_log(copy, broken=3)) != before
    monkeypatch.setattr(prepared, "VERSION", "99.0")
    assert of(a_log) != before


CODES = "labels = { road = [3] }"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two drives with the same frames: one truth is a 0/255 mask, one holds class ids."""
    folder = tmp_path_factory.mktemp("drives")
    mask = write_log(folder / "mask.mcap")
    return mask, write_log(folder / "ids.mcap", codes=(5, 3))


def train(paths, folder, **options):
    made = settings(train_frames=3, **options)
    return roadeval.train(paths, folder / "m.model", made)


def described(drive, tables):
    """Write a manifest of a drive beside it."""
    path = drive.with_suffix(".toml")
    path.write_text(f'[[drives]]\npath = "{drive.name}"\n{tables}\n')
    return path


def test_a_drive_may_have_labels_of_its_own(drives, tmp_path):
    model = train([drives[0], described(drives[1], CODES)], tmp_path)
    assert model.warnings == ()
    # Road and non-road are the same pixels in both, so either drive alone gives the same prior.
    assert (model.prior == train(drives[:1], tmp_path).prior).all()


def test_labels_of_its_own_that_do_not_occur_are_refused(drives, tmp_path):
    wrong = described(drives[0], "labels = { road = [4] }")
    with pytest.raises(RoadevalError, match=r"4 does not occur .*0 255$") as refused:
        train([wrong, drives[1]], tmp_path, road=[3])
    assert (refused.value.where, refused.value.setting) == ("mask.mcap", "labels.road")


def split_without_its_second_file(folder):
    """A folder of a split log; one of its files is not a log."""
    folder.mkdir()
    write_log(folder / "split_0.mcap")
    (folder / "split_1.mcap").write_bytes(b"no log")
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    return folder


def test_what_is_lost_of_a_log_is_told_and_of_several_with_its_name(tmp_path):
    logs = write_log(tmp_path / "a.mcap", broken=0), split_without_its_second_file(tmp_path / "b")
    lost = [loss.partition(": ")[0] for loss in train(logs[1:], tmp_path).losses]
    assert lost == ["split_1.mcap", "/camera/image", "/truth/road"]
    losses = train(logs, tmp_path).losses
    assert [loss.split(": ")[:2] for loss in losses] == [
        ["a.mcap", "frame 0"],
        ["a.mcap", "1 of 3 training frames could not be decoded"],
        ["b", "split_1.mcap"],
        ["b", "/camera/image"],
        ["b", "/truth/road"],
    ]


def test_a_drive_of_which_no_training_frame_can_be_decoded_is_refused(tmp_path):
    broken = write_log(tmp_path / "broken.mcap", broken=0)
    with pytest.raises(RoadevalError, match=r"broken.mcap: no training frame .*: frame 0: 8 bytes"):
        train([broken], tmp_path, max_frames=1)
