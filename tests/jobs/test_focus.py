"""The focus, the variant that results are about: chosen before a replay, or after it."""

from pathlib import Path

import pytest

import roadeval
from roadeval import RoadevalError
from roadeval.data import BASELINE
from roadeval.jobs.results.inspect import worst_frames
from roadeval.jobs.results.report import findings_of
from roadeval.results.facts import Facts
from roadeval.results.fleet import FleetFolder
from roadeval.results.verdict import verdict_on, verdicts
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here, write
from tests.jobs.making import settings, write_log


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    return write_log(tmp_path_factory.mktemp("drive") / "drive.mcap", net=True)


@pytest.fixture(scope="module")
def outcome(drive):
    config = settings(masks={"net": "/net/road_mask_prediction"})
    place = drive.parent
    return roadeval.replay(drive, config, save=place / "out.rrd", reports=place / "out")


def variants(facts: Facts) -> list[str]:
    return [name for name in facts.finals if name != BASELINE]


def test_every_variant_has_its_verdict_without_a_replay(outcome):
    sentences = verdicts(roadeval.Result(outcome.reports).facts)
    assert [*sentences] == variants(outcome.facts) == ["filtered", "unfiltered", "net"]
    assert sentences["net"] == outcome.facts.verdict == verdict_on(outcome.facts)
    assert all(text.startswith(f"{name}: ") for name, text in sentences.items())
    assert "without the filter" in sentences["filtered"]
    assert "without the filter" not in sentences["unfiltered"]


@pytest.mark.parametrize("place", ["recording", "reports"])
def test_another_focus_of_a_result_changes_verdict_and_worst_frames(outcome, place):
    path = getattr(outcome, place)
    result = roadeval.Result(path, focus="unfiltered")
    assert result.facts.verdict == verdicts(outcome.facts)["unfiltered"]
    assert {frame.variant for frame in worst_frames(result)} == {"unfiltered"}
    assert {frame.variant for frame in worst_frames(roadeval.Result(path))} == {"net"}
    assert {frame.variant for frame in findings_of(result).worst} == {"unfiltered"}
    with pytest.raises(RoadevalError, match="did you mean unfiltered"):
        roadeval.Result(path, focus="unfilterd")


def test_a_replay_stores_the_focus_that_was_chosen(drive, tmp_path):
    config = settings(masks={"net": "/net/road_mask_prediction"})
    config = config.override({"output": {"focus": "filtered", "record": "worst:2"}})
    outcome = roadeval.replay(drive, config, save=tmp_path / "out.rrd", reports=tmp_path / "out")
    for path in (outcome.recording, outcome.reports):
        facts = roadeval.Result(path).facts
        assert facts.focus == "filtered"
        assert facts.verdict.startswith("filtered: ")
    again = roadeval.load_config(tmp_path / "out" / "run.toml")
    assert again.output.focus == "filtered"
    wrong = config.override({"output": {"focus": "nett"}})
    with pytest.raises(RoadevalError, match="did you mean net"):
        roadeval.replay(drive, wrong, save=tmp_path / "b.rrd", reports=tmp_path / "b")


def test_without_truth_the_frames_to_look_at_are_those_of_the_focus(tmp_path):
    log = write_log(tmp_path / "bare.mcap", truth=False, net=True)
    config = settings(masks={"net": "/net/road_mask_prediction"})
    outcome = roadeval.replay(log, config, save=tmp_path / "out.rrd", reports=tmp_path / "out")
    assert outcome.facts.unlabelled.variant == "net"
    result = roadeval.Result(outcome.reports, focus="filtered")
    assert result.facts.unlabelled.variant == "filtered"
    assert worst_frames(result)[0].variant == "filtered"
    stored = roadeval.Result(outcome.reports)
    sentences = verdicts(stored.facts, stored.table("unlabelled"))
    assert sentences["net"] == stored.facts.verdict
    assert sentences["filtered"] == result.facts.verdict


def test_the_table_and_the_worst_frames_of_a_fleet_are_those_of_the_focus(tmp_path):
    write(tmp_path / "a.mcap", 0)
    write(tmp_path / "b.mcap", 100)

    def run(**output):
        executor, config = Here(), settings(train_frames=3).override({"output": output})
        logs = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
        done = roadeval.replay_fleet(logs, tmp_path / "fleet", config, executor=executor)
        return done.facts, FleetFolder(tmp_path / "fleet")

    facts, _ = run()
    assert facts.focus == "filtered"
    other = FleetFolder(tmp_path / "fleet", "unfiltered")
    first = [*other.worst[["drive", "frame"]].itertuples(index=False, name=None)]
    assert not any(map(other.picture, other.worst.to_dict("records")))
    facts, chosen = run(focus="unfiltered")
    assert facts.verdict == other.facts.verdict
    assert facts.verdict.startswith("unfiltered: ")
    for folder in (chosen, other):
        assert {*folder.worst["variant"]} == {*folder.focus_scores["variant"]} == {"unfiltered"}
    assert [*chosen.worst[["drive", "frame"]].itertuples(index=False, name=None)] == first
    assert all(map(chosen.picture, chosen.worst.to_dict("records")))
    wrong = settings().override({"output": {"focus": "unfilterd"}})
    with pytest.raises(RoadevalError, match="did you mean unfiltered"):
        roadeval.replay_fleet([tmp_path / "a.mcap"], tmp_path / "f", wrong, executor=Here())


@pytest.mark.parametrize(
    ("words", "focus"),
    [
        (["--masks", "mine=folder", "--variant", "wide=robust"], "mine"),
        (["--variant", "wide=robust", "--masks", "mine=folder"], None),
        (["--masks", "mine=folder", "--variant", "wide=robust", "--focus", "wide"], "wide"),
    ],
)
def test_the_first_variant_that_was_typed_is_the_focus(words, focus):
    """By themselves computed variants come before masks."""
    run = here("config", *words, "--preset", "paper")
    assert run.returncode == 0
    assert (f'focus = "{focus}"' if focus else "# focus =") in run.stdout


def test_a_preset_without_a_filter_is_a_variant_of_its_name(drive, tmp_path):
    """A method beside it is the focus, as it is beside `filtered`."""
    config = settings(masks={"net": "/net/road_mask_prediction"}, train_frames=5).override(
        {"chain": ["trees", "post"], "trees": {"trees": 2, "features": ["place"]}}
    )
    robust = roadeval.configure(config.as_dict() | {"preset": "robust"})
    outcome = roadeval.replay(drive, robust, save=tmp_path / "r.rrd", reports=tmp_path / "r")
    assert [*outcome.facts.finals] == ["robust", "net", BASELINE]
    assert outcome.facts.focus == roadeval.Result(outcome.recording).facts.focus == "net"
    assert outcome.summary["difference"] == outcome.summary["against_unfiltered"] == {}
    assert [v.name for v in config.variants()] == ["unfiltered"]
