"""A replay under disturbances: undisturbed results stay, and every variant is scored once more."""

import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval.images.disturbing import Disturbance
from roadeval.jobs.results.result import number_settings
from tests.e2e.test_fleet import Here
from tests.jobs.making import settings, write_log

FOG = "fog:2"
TEXTS = ["fog:0", FOG, "exposure:-1,noise:2"]
NAMES = ["fog-0", "fog-2", "exposure-minus1", "noise-2"]
MASKS = {"net": "/net/road_mask_prediction"}
COUNTS = ["TP", "TN", "FP", "FN"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap", net=True)


def run(drive, folder, **options):
    config = settings(**{"jobs": 1, "max_frames": 18, **options})
    return roadeval.replay(drive, config, save=folder / "o.rrd", reports=folder / "reports")


@pytest.fixture(scope="module")
def ran(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("once")
    return folder, run(drive, folder, disturb=TEXTS, masks=MASKS)


def rows_of(folder, name="disturbances"):
    return pd.read_csv(folder / "reports" / f"{name}.csv")


def test_undisturbed_results_are_the_same_bytes_as_without(drive, ran, tmp_path):
    folder, outcome = ran
    plain = run(drive, tmp_path, masks=MASKS)
    for path in (tmp_path / "reports").glob("*.csv"):
        assert (folder / "reports" / path.name).read_bytes() == path.read_bytes()
    assert "disturbances" not in plain.summary
    for part in ("verdict", "totals", "difference", "frames"):
        assert outcome.summary[part] == plain.summary[part]


def test_any_number_of_threads_gives_the_same_bytes(drive, ran, tmp_path):
    run(drive, tmp_path, disturb=TEXTS, masks=MASKS, jobs=2)
    assert rows_of(tmp_path).equals(rows_of(ran[0]))
    ours, theirs = (roadeval.Recording(path / "o.rrd") for path in (tmp_path, ran[0]))
    for name in NAMES:
        paths = f"disturbed/{name}/filtered", "post", 17
        assert np.array_equal(ours.layer(*paths), theirs.layer(*paths))


def test_strength_0_counts_as_the_frame_itself_does(ran):
    folder, outcome = ran
    frames = rows_of(folder, "frames").query("stage == 'post'")
    frames = frames[frames.variant.isin(outcome.facts.disturbances)]
    rows = rows_of(folder).query("disturbance == 'fog-0'")
    assert rows[COUNTS].to_numpy().tolist() == frames[COUNTS].to_numpy().tolist()
    assert outcome.facts.disturbances["filtered"]["fog-0"].difference.mean == 0


def test_what_is_recorded_is_what_was_counted(ran):
    folder, _ = ran
    recording = roadeval.Recording(folder / "o.rrd")
    row = rows_of(folder).query("disturbance == 'fog-2' and variant == 'filtered'").iloc[-1]
    mask = recording.layer("disturbed/fog-2/filtered", "post", row.frame)
    errors = recording.layer("disturbed/fog-2/filtered", "errors", row.frame)
    truth = recording.truth(row.frame)
    wrong = [((mask == 1) & (truth == 0)).sum(), ((mask == 0) & (truth == 1)).sum()]
    assert wrong == [row.FP, row.FN]
    assert [(errors == 2).sum(), (errors == 3).sum()] == [row.FP, row.FN]
    image = recording.image(row.frame).astype(int)
    fogged = Disturbance.parse(FOG).of(recording.image(row.frame), row.frame)
    shown = recording.layer("disturbed/fog-2", "camera", row.frame)
    assert np.abs(shown - fogged.astype(int)).mean() < 8 < np.abs(image - fogged).mean()


def test_facts_are_the_paired_change_by_variant_and_disturbance(ran):
    folder, outcome = ran
    assert [*outcome.facts.disturbances] == ["filtered", "unfiltered"]
    changes = outcome.facts.disturbances["unfiltered"]
    assert [*changes] == NAMES
    rows = rows_of(folder).query("disturbance == 'noise-2' and variant == 'unfiltered'")
    base = outcome.facts.totals["unfiltered"]["post"]["ERR"]
    change = changes["noise-2"]
    assert (change.kind, change.strength) == ("noise", 2)
    assert pytest.approx(rows.ERR.mean()) == change.ERR
    assert change.base_ERR == pytest.approx(base)
    assert change.difference.mean == pytest.approx(rows.ERR.mean() - base)
    assert roadeval.Result(folder / "reports").facts.disturbances == outcome.facts.disturbances


def test_masks_from_elsewhere_cannot_be_disturbed_which_is_said_once(ran):
    told = [str(text) for text in ran[1].warnings if "of the undisturbed images" in text]
    assert told == [
        "`frames.disturb`: not for net, because their masks were made of the undisturbed images"
    ]


def test_masks_from_elsewhere_alone_are_recorded_without_a_disturbance(drive, tmp_path):
    outcome = run(drive, tmp_path, disturb=[FOG], masks=MASKS, only=["net"])
    assert roadeval.Recording(outcome.recording).variants
    assert not outcome.facts.disturbances


def test_without_truth_nothing_is_disturbed(drive, tmp_path):
    outcome = run(drive, tmp_path, disturb=[FOG], truth="", only=["unfiltered"])
    assert not (tmp_path / "reports" / "disturbances.csv").exists()
    assert any("nothing is disturbed without truth" in text for text in outcome.warnings)


def test_a_failure_under_a_disturbance_is_told_and_the_frame_itself_is_scored(drive, tmp_path):
    dark = {"mine": {"chain": ["tests.pipeline.somebody:fails_in_the_dark", "post"]}}
    outcome = run(drive, tmp_path, variants=dark, disturb=["exposure:-6", FOG])
    (loss,) = outcome.losses
    assert loss.startswith("8 frames (")
    assert "variant mine: exposure:-6: stage fails_in_the_dark failed" in loss
    assert outcome.summary["frames"]["evaluated"] == 8
    assert "failed in a stage" not in outcome.summary["frames"]["skipped"]
    assert [*outcome.facts.disturbances["mine"]] == ["fog-2"]


@pytest.mark.parametrize(
    "given", [["fog:2", "dark:1.50"], ["fog:2,dark:1.5"], ["fog:2", "fog:2.0,dark:1.5"]]
)
def test_disturbances_are_named_in_any_number_of_texts(given):
    config = roadeval.configure({"frames": {"disturb": given}})
    assert config.frames.disturb == ("fog:2", "dark:1.5")


def test_a_fleet_averages_its_drives(tmp_path):
    for name, numbers in (("a", range(18)), ("b", range(4, 26))):
        write_log(tmp_path / f"logs/{name}.mcap", numbers=numbers)
    config = settings(disturb=[FOG], only=["unfiltered"])
    outcome = roadeval.replay_fleet([tmp_path / "logs"], tmp_path / "f", config, executor=Here())
    result = roadeval.Result(tmp_path / "f")
    change = result.facts.disturbances["unfiltered"]["fog-2"]
    rows = result.table("disturbances")
    by_drive = rows.groupby("drive", observed=True).ERR.mean()
    assert len(by_drive) == change.difference.units == 2
    assert change.difference.unit == "drives"
    assert pytest.approx(by_drive.mean()) == change.ERR
    assert change.difference.mean == pytest.approx(change.ERR - change.base_ERR)
    assert outcome.facts.disturbances == result.facts.disturbances


def test_other_disturbances_change_no_number_that_is_compared():
    by_text = [roadeval.configure({"frames": {"disturb": texts}}) for texts in ([], [FOG])]
    plain, foggy = (number_settings(config.as_dict()) for config in by_text)
    assert plain == foggy
