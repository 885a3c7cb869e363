"""The main job, on a small log of our own."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from rerun.chunk import RrdReader

import roadeval
from roadeval import RoadevalError
from roadeval.jobs.progress import ignore
from roadeval.jobs.run.prepared import prepare, process
from roadeval.logs import LogConfig, TopicSettings, open_log
from roadeval.pipeline.paper import svm
from roadeval.report import figures as drawn
from roadeval.results import schema
from roadeval.results.folder import ResultsFolder
from roadeval.training import learning
from tests.fixtures.make import make
from tests.jobs.making import FRAMES, NS, settings, write_log

TABLES = tuple(name for name in schema.OF_A_DRIVE if name != "probabilities")
"""Those of runs in which nothing says how probable road is."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "small.mcap", net=True)


def run(drive: Path, folder: Path, **options):
    save = None if options.get("record") == "none" else folder / "out.rrd"
    config = settings(**{"ground": {"height": 1.4, "pitch": 3, "fov": 60}, **options})
    return roadeval.replay(drive, config, save=save, reports=folder / "reports")


def identity_of(recording: Path) -> str:
    """By which Rerun's viewer and catalogue tell recordings apart."""
    (entry,) = RrdReader(recording).recordings()
    return entry.recording_id


def frames_of(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "reports" / "frames.csv")


@pytest.fixture(scope="module")
def once(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("once")
    return folder, run(drive, folder, jobs=2)


def test_every_frame_is_accounted_for(once):
    _, outcome = once
    assert outcome.summary["frames"] == {
        "in_log": 26,
        "read": 26,
        "decoded": 26,
        "labelled": 25,
        "trained_on": 10,
        "evaluated": 15,
        "skipped": {"trained on": 10, "unlabelled": 1},
    }
    assert outcome.summary["windows"] == 2


def test_training_and_unlabelled_frames_are_in_no_table(once):
    folder, _ = once
    assert sorted(set(frames_of(folder).frame)) == [*range(10, 20), *range(21, 26)]
    regions = pd.read_csv(folder / "reports" / "regions.csv")
    assert set(regions.frame) == set(frames_of(folder).frame)


def test_the_summary_file_is_the_outcome_s_summary(once):
    folder, outcome = once
    written = json.loads((folder / "reports" / "summary.json").read_text())
    assert written["format"] == {"name": "roadeval-summary", "version": 4}
    assert written == json.loads(outcome.facts.text())


def test_the_number_of_workers_changes_no_number_and_no_identity(drive, once, tmp_path):
    outcome = run(drive, tmp_path, jobs=1)
    for table in TABLES:
        other = (tmp_path / "reports" / f"{table}.csv").read_bytes()
        assert other == (once[0] / "reports" / f"{table}.csv").read_bytes()
    assert identity_of(outcome.recording) == identity_of(once[1].recording)


def test_frames_after_training_can_be_left_out(drive, tmp_path):
    outcome = run(drive, tmp_path, train_frames=4, gap=5)
    assert outcome.summary["frames"]["skipped"]["gap after training"] == 5
    assert frames_of(tmp_path).frame.min() == 9


def test_training_frames_of_the_drive_itself_are_left_out_and_warned_of(drive, tmp_path):
    model = roadeval.train([drive], tmp_path / "m.model", settings(train_frames=5))
    outcome = run(drive, tmp_path, model=tmp_path / "m.model")
    assert outcome.summary["frames"]["trained_on"] == len(model.digests) == 5
    assert outcome.summary["frames"]["evaluated"] == 20
    warned = "5 of the model's 5 training frames lie in this drive; their"
    assert any(warned in text for text in outcome.summary["warnings"])


@pytest.fixture(scope="module")
def of_five(tmp_path_factory):
    """A model of five frames of the drive."""
    folder = tmp_path_factory.mktemp("five")
    log = write_log(folder / "five.mcap", numbers=[0, 5, 10, 15, 21])
    roadeval.train([log], folder / "m.model", settings(train_frames=5))
    return folder / "m.model"


def test_the_variants_of_a_model_file_are_bound_once(drive, tmp_path, monkeypatch):
    roadeval.train([drive], tmp_path / "m.model")
    bound = []

    def table(machine, settings):
        bound.append(machine)
        return made(machine, settings)

    made = svm.colour_table
    monkeypatch.setattr(svm, "colour_table", table)
    run(drive, tmp_path, model=tmp_path / "m.model", max_frames=3)
    assert len(bound) == len({id(machine) for machine in bound}) == 2


def test_a_model_of_another_drive_is_not_warned_of(drive, tmp_path):
    half = settings(train_frames=5, end="1.25")
    roadeval.train([drive], tmp_path / "m.model", half)
    outcome = run(drive, tmp_path, model=tmp_path / "m.model", start="1.25")
    assert outcome.summary["frames"]["evaluated"] > 0
    assert not [text for text in outcome.warnings if "training frames lie" in text]


def test_a_range_without_truth_is_replayed_by_the_patch(drive, tmp_path):
    # Frame 20 alone has no truth.
    outcome = run(drive, tmp_path, start="2.0", end="2.1")
    assert outcome.summary["training"]["source"] == "patch"
    assert outcome.summary["frames"]["evaluated"] == 0
    assert any("no frame that is read has road truth" in text for text in outcome.warnings)


def test_a_log_without_truth_trains_a_model_for_others(drive, tmp_path):
    bare = write_log(tmp_path / "bare.mcap", truth=False)
    patch = settings(source="patch")
    assert roadeval.train([bare], tmp_path / "m.model", patch).source == "patch"
    assert roadeval.train([bare, drive], tmp_path / "m.model", patch).source == "patch"
    assert run(bare, tmp_path, model=tmp_path / "m.model").summary["training"]["frames"] == 10


def test_the_memory_of_training_is_bounded_over_all_drives(drive, tmp_path, monkeypatch):
    other = write_log(tmp_path / "other.mcap")
    monkeypatch.setattr("roadeval.training.learning.GREATEST_MEMORY", 15 * 10_000)
    with pytest.raises(RoadevalError, match=r"more than 1\d of them would take"):
        roadeval.train([drive, other], tmp_path / "m.model")


def test_a_drive_without_truth_is_no_help_to_others(drive, tmp_path):
    bare = write_log(tmp_path / "bare.mcap", truth=False)
    with pytest.raises(RoadevalError, match=r"bare\.mcap: no road truth to train on"):
        roadeval.train([drive, bare], tmp_path / "m.model")
    assert not (tmp_path / "m.model").exists()


def test_a_model_made_for_other_settings_is_refused(drive, tmp_path):
    roadeval.train([drive], tmp_path / "m.model")
    with pytest.raises(RoadevalError, match=r"gamma 0.5 there, 3.0 here"):
        run(drive, tmp_path, model=tmp_path / "m.model", svm={"gamma": 3.0})
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.model"]


def test_a_further_variant_is_run_like_the_two(drive, tmp_path):
    wide = {"shadow": {"ring_width": 3}}
    outcome = run(drive, tmp_path, variants={"wide": wide}, max_frames=16)
    assert set(outcome.summary["totals"]["wide"]) == {"similarity", "svm", "post"}
    assert roadeval.Recording(outcome.recording).layer("wide", "rings", 12).max() == 2


def test_a_mask_in_the_log_is_scored_as_a_variant_without_oracles(drive, tmp_path):
    outcome = run(drive, tmp_path, masks={"net": "/net/road_mask_prediction"})
    total = outcome.summary["totals"]["net"]["post"]
    assert (total["ERR"], total["frames"]) == (0, 15)
    assert roadeval.Recording(outcome.recording).layer("net", "post", 12).max() == 1
    assert set(outcome.summary["oracles"]) == {"filtered", "unfiltered"}
    assert outcome.summary["beyond"]["net"]["boundary_F"] == 1


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


@pytest.mark.parametrize("jobs", [1, 3])
def test_the_worst_frames_pictures_are_those_of_the_highest_err(drive, tmp_path, jobs):
    recording = roadeval.Recording(run(drive, tmp_path, record="worst:4", jobs=jobs).recording)
    final = frames_of(tmp_path).query("stage == 'post' and variant != 'blind'")
    worst = final.groupby("frame").ERR.max().sort_values(ascending=False, kind="stable")
    assert list(recording.frame_numbers) == sorted(worst.index[:4])


def test_an_error_on_the_way_leaves_no_results_and_a_partial_recording(
    drive, tmp_path, monkeypatch
):
    from roadeval.evaluation.score import Scoreboard

    add = Scoreboard.add

    def fail(self, result):
        if result.frame.number == 12:
            raise KeyboardInterrupt
        return add(self, result)

    monkeypatch.setattr(Scoreboard, "add", fail)
    with pytest.raises(KeyboardInterrupt):
        run(drive, tmp_path)
    (left,) = tmp_path.iterdir()
    assert re.fullmatch(r"out\.[0-9a-f]{8}\.partial\.rrd", left.name)
    partial = roadeval.Recording(left)
    assert not partial.complete
    assert partial.layer("unfiltered", "svm", 5).shape == (24, 32)


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


def test_a_recording_whose_name_is_taken_away_at_the_end_is_told_where_it_is(
    drive, tmp_path, monkeypatch
):
    def take(*given):
        (tmp_path / "out.rrd").mkdir()
        return []

    monkeypatch.setattr(drawn, "write_figures", take)
    with pytest.raises(RoadevalError, match=r"out\.rrd: cannot be written: Is a") as caught:
        run(drive, tmp_path, max_frames=12)
    (left,) = tmp_path.glob("out.*.partial.rrd")
    assert caught.value.__notes__ == [f"the partial recording is {left}"]
    assert ResultsFolder(tmp_path / "reports").facts.frames.evaluated == 2


def test_a_run_that_ends_removes_an_earlier_one_s_partial_recording(drive, tmp_path):
    left = tmp_path / "out.0123abcd.partial.rrd"
    left.write_text("some frames")
    run(drive, tmp_path, max_frames=12)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.rrd", "reports"]
    assert not [*(tmp_path / "reports").glob(".*")]


def test_a_run_that_fails_leaves_an_earlier_one_s_partial_recording(drive, tmp_path):
    left = tmp_path / "out.0123abcd.partial.rrd"
    left.write_text("some frames")
    with pytest.raises(RoadevalError, match="no frame in this range"):
        run(drive, tmp_path, start="1000")
    assert [path.name for path in tmp_path.iterdir()] == [left.name]


def test_a_name_for_a_recording_that_is_not_made_is_warned_of(drive, tmp_path):
    config = settings(record="none", max_frames=12)
    outcome = roadeval.replay(drive, config, save=tmp_path / "o.rrd", reports=tmp_path / "r")
    said = f"`output.save` {tmp_path / 'o.rrd'} is not written: `output.record` is none"
    assert said in outcome.warnings
    assert [path.name for path in tmp_path.iterdir()] == ["r"]
    unnamed = roadeval.replay(drive, config, reports=tmp_path / "r")
    assert not [each for each in unnamed.warnings if "output.save" in each]


def test_an_output_never_replaces_the_drive(tmp_path):
    log = write_log(tmp_path / "small.mcap")
    before = log.read_bytes()
    with pytest.raises(RoadevalError, match="is an input or another output"):
        roadeval.replay(log, save=tmp_path / "o.rrd", reports=tmp_path, mcap=log)
    with pytest.raises(RoadevalError, match=r"name a file that ends in \.rrd"):
        roadeval.replay(log, save=log, reports=tmp_path)
    with pytest.raises(RoadevalError, match="is an input or another output"):
        roadeval.train([log], log)
    assert log.read_bytes() == before


def test_a_variant_whose_preset_trains_otherwise_is_trained_like_the_rest_and_warned_of():
    robust = {"variants": {"v": {"preset": "robust"}}}
    (pixels, most) = roadeval.configure(robust).ignored()
    assert "v: preset robust asks for training.pixels_per_class = 1000" in pixels
    assert "training.max_pixels = 50000" in most
    assert roadeval.configure({"preset": "robust"} | robust).ignored() == ()


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


def test_the_summary_holds_the_run_s_configuration(drive, tmp_path):
    config = settings(
        truth="/truth/road",
        road=[255],
        start="0.2",
        every=2,
        max_frames=12,
        record="none",
        resize_truth=True,
        train_frames=4,
        variants={"wide": {"shadow": {"ring_width": 3}}},
    )
    roadeval.replay(drive, config, save=tmp_path / "o.rrd", reports=tmp_path)
    written = json.loads((tmp_path / "summary.json").read_text())
    outputs = {"save": str(tmp_path / "o.rrd"), "reports": str(tmp_path)}
    whole = config.override({"output": outputs})
    assert written["run"] == json.loads(json.dumps(whole.as_dict()))
    assert written["settings"]["unfiltered"]["chain"] == ["similarity", "svm", "post"]
    assert written["settings"]["wide"]["shadow"]["ring_width"] == 3


def test_changes_are_what_the_recorded_masks_show(once):
    folder, outcome = once
    recording = roadeval.Recording(outcome.recording)
    changes = ResultsFolder(folder / "reports").table("changes")
    step = changes.query("from_stage == 'similarity' and to_variant == 'unfiltered'").iloc[0]
    repaired = spoiled = 0
    for number in frames_of(folder).frame.unique():
        truth = recording.truth(number)
        before, after = (
            recording.layer("unfiltered", stage, number) for stage in ("similarity", "svm")
        )
        repaired += ((before != truth) & (after == truth)).sum()
        spoiled += ((before == truth) & (after != truth)).sum()
    assert repaired + spoiled > 0
    assert (step.repaired, step.spoiled, step.N) == (repaired, spoiled, 15 * 24 * 32)


def test_a_perfect_svm_is_counted_on_evaluated_frames_alone_and_in_no_other_table(once):
    folder, outcome = once
    oracles = ResultsFolder(folder / "reports").table("oracles")
    assert set(zip(oracles.variant, oracles.oracle, oracles.stage, strict=True)) == {
        (variant, "svm", "post") for variant in ("filtered", "unfiltered")
    }
    assert set(oracles.frame) == set(frames_of(folder).frame)
    total = outcome.summary["oracles"]["filtered"]["svm"]["post"]
    assert total["frames"] == 15
    assert total["FP"] == oracles[oracles.variant == "filtered"].FP.sum()


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


def test_reduced_frames_and_a_model_of_another_size_are_told(drive, tmp_path):
    roadeval.train([drive], tmp_path / "m.model", settings(scale=0.5))
    warnings = " ".join(run(drive, tmp_path, model=tmp_path / "m.model").warnings)
    assert "the model learnt from frames of" in warnings
    assert "are reduced to" not in warnings
    same = run(drive, tmp_path, model=tmp_path / "m.model", scale=0.5)
    warnings = " ".join(same.summary["warnings"])
    assert "in the log, are reduced to 0.5 of it" in warnings
    assert "the model learnt from frames of" not in warnings


def test_reduced_masks_do_not_go_beside_the_log(drive, tmp_path):
    with pytest.raises(RoadevalError, match=r"`output\.mcap` and `frames\.scale` do not go"):
        roadeval.replay(drive, settings(scale=0.5), mcap=tmp_path / "o.mcap")


def test_results_that_wait_have_lost_their_layers_but_not_their_masks(drive):
    class Seen:
        def encode(self, result, position):
            return result

    options = settings(max_frames=14)
    with open_log(drive) as log:
        *_, (_, done) = process([prepare(log, options, ignore)], Seen(), ignore)
    lean, whole = done.result, done.encoded
    assert any(list(variant.layers()) for variant in whole.variants)
    assert not any(list(variant.layers()) for variant in lean.variants)
    assert lean.tallies == whole.tallies
    for mine, its in zip(lean.variants, whole.variants, strict=True):
        assert [name for name, _ in mine.masks()] == [name for name, _ in its.masks()]


def test_further_seeds_tell_the_spread_and_change_no_table(drive, tmp_path):
    common = {"record": "none", "train_frames": 3, "max_frames": 12, "seed": 4}
    alone, other, both = (
        run(drive, tmp_path / name, **common | given)
        for name, given in {"a": {}, "b": {"seed": 5}, "c": {"seeds": 2, "jobs": 3}}.items()
    )
    for table in ("frames", "oracles", "windows"):
        first, again = (tmp_path / name / "reports" / f"{table}.csv" for name in "ac")
        assert first.read_bytes() == again.read_bytes()
    assert "seeds" not in alone.summary
    seeds = both.summary["seeds"]
    assert seeds["seeds"] == [4, 5]
    for variant, stages in seeds["totals"].items():
        for stage, rates in stages.items():
            for rate, values in rates.items():
                each = [run.summary["totals"][variant][stage][rate] for run in (alone, other)]
                assert values == each
    assert list(seeds["totals"]) == ["filtered", "unfiltered"]
    for stage, rates in seeds["difference"].items():
        for rate, values in rates.items():
            each = [run.summary["difference"][stage][rate]["mean"] for run in (alone, other)]
            assert values == each


def test_without_truth_there_is_no_rate_for_seeds_to_spread(tmp_path, monkeypatch):
    def counted(*given, **named):
        fits.append(given)
        return fit(*given, **named)

    fits, fit = [], learning.fit
    monkeypatch.setattr(learning, "fit", counted)
    bare = write_log(tmp_path / "bare.mcap", truth=False, numbers=range(4))
    outcome = run(bare, tmp_path, seeds=3, train_frames=2, record="none")
    assert len(fits) == 1
    assert "seeds" not in outcome.summary
    assert outcome.warnings[0].startswith("there is no road truth to score against")
