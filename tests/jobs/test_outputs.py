"""Outputs: that they can be written is known, and held, before anything is computed."""

import os
import re
import sys
from pathlib import Path

import pytest

import roadeval
from roadeval import RoadevalError, write_report
from roadeval.config.settings import OutputSettings
from roadeval.jobs.outputs import Outputs, holding
from roadeval.jobs.results import inspect
from roadeval.jobs.results.result import DriveResult
from roadeval.logs.log import Log
from tests.faults import making
from tests.jobs.making import write_log
from tests.recording.making import record, result


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def to(tmp_path):
    return Outputs(tmp_path / "out.rrd", tmp_path / "reports", tmp_path / "out.mcap")


def test_they_land_under_the_drive_s_name_or_where_the_settings_say(tmp_path):
    usual = Outputs.of(OutputSettings(), "drive")
    assert [str(usual.recording), str(usual.reports)] == ["recordings/drive.rrd", "reports/drive"]
    assert usual.mcap is None
    own = Outputs.of(OutputSettings("a.rrd", "b", "c.mcap"), "drive")
    assert [str(own.recording), str(own.reports), str(own.mcap)] == ["a.rrd", "b", "c.mcap"]
    assert Outputs.of(OutputSettings("a.rrd", record="none"), "drive").recording is None


@pytest.mark.parametrize(
    ("save", "folder"),
    [("new.rrd", "reports/new"), ("to/a.b.rrd", "reports/a.b"), ("..rrd", "reports/drive")],
)
def test_a_recording_of_another_name_has_a_results_folder_of_that_name(save, folder):
    assert Outputs.of(OutputSettings(save), "drive").reports == Path(folder)


@pytest.mark.parametrize(
    ("sign", "own"), [("summary.json", "frames.csv"), ("fleet.json", "drives.parquet")]
)
def test_the_files_of_an_input_folder_are_inputs_and_others_may_lie_beside_them(
    sign, own, tmp_path
):
    (tmp_path / sign).write_text("{}")
    for name in (sign, own, "run.toml"):
        with pytest.raises(RoadevalError, match="is an input or another output"):
            holding(tmp_path / name, inputs=[tmp_path]).__enter__()
    with holding(tmp_path / "report.pdf", inputs=[tmp_path]):
        pass


@pytest.mark.parametrize("name", ["recording", "reports", "mcap"])
def test_whoever_shares_one_output_with_another_run_is_refused(name, to, tmp_path):
    other = Outputs(tmp_path / "o.rrd", tmp_path / "o", tmp_path / "o.mcap")
    shared = Outputs(
        **{
            each: getattr(to if each == name else other, each)
            for each in ("recording", "reports", "mcap")
        }
    )
    with to.holding(()):
        before = names(tmp_path)
        with pytest.raises(RoadevalError) as caught, shared.holding(()):
            pass
        who = rf"process {os.getpid()} on .*, since .*"
        assert re.fullmatch(
            rf"{re.escape(str(getattr(to, name)))}: another run is writing it \({who}\); "
            "wait until it has ended, or write elsewhere",
            str(caught.value),
        )
        assert names(tmp_path) == before
        with other.holding(()):
            pass
    assert names(tmp_path) == []


def test_what_killed_runs_left_goes_when_a_run_has_ended(to, tmp_path):
    for name in (".out.0123abcd.partial.mcap", ".out.mcap.lock", "out.00000003.partial.rrd"):
        (tmp_path / name).touch()
    for name in ("reports/.reports.0123abcd.partial", "out.00000001.partial.rrd-images"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "frames.csv").touch()
    (tmp_path / "out.00000002.partial.rrd").write_text("some frames")
    with to.holding(()):
        assert "out.00000002.partial.rrd" in names(tmp_path)
    assert names(tmp_path) == ["reports"]
    assert names(to.reports) == []


def test_without_locks_nothing_that_may_be_another_run_s_is_removed(to, tmp_path, monkeypatch):
    left = [".out.0123abcd.partial.mcap", "out.00000001.partial.rrd"]
    for path in (*left, "reports/.reports.0123abcd.partial"):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).touch()
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with to.holding(()), to.holding(()):
        pass
    assert names(tmp_path) == [*left, "reports"]
    assert names(to.reports) == [".reports.0123abcd.partial"]


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        (["a.rrd"], {}),
        (["a.mcap"], {}),
        ([], {"mcap": "a.rrd"}),
        ([], {"reports": "a.rrd"}),
        ([], {"reports": "./x/../a.mcap"}),
    ],
)
def test_an_input_or_another_output_is_no_output(inputs, outputs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    places = {"save": "a.rrd", "reports": "r", "mcap": "a.mcap"} | outputs
    to = Outputs.of(OutputSettings(**places), "drive")
    with pytest.raises(RoadevalError, match="is an input or another output"), to.holding(inputs):
        pass
    assert names(tmp_path) == []


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "small.mcap")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a recording and a results folder."""
    folder = tmp_path_factory.mktemp("made")
    making.run(folder, "old")
    record(folder / "out.rrd", [result(number) for number in range(2)])
    return folder


COMMANDS = {
    "replay, recording": lambda drive, made, taken: roadeval.replay(drive, save=taken),
    "replay, reports": lambda drive, made, taken: roadeval.replay(drive, reports=taken),
    "replay, mcap": lambda drive, made, taken: roadeval.replay(drive, mcap=taken),
    "train": lambda drive, made, taken: roadeval.train([drive], taken),
    "report": lambda drive, made, taken: write_report(made / "reports", taken),
    "pack": lambda drive, made, taken: roadeval.pack(made, taken),
    "demo": lambda drive, made, taken: roadeval.demo(taken),
    "screenshot": lambda drive, made, taken: inspect.view(DriveResult(made / "out.rrd"), 1, taken),
}


@pytest.fixture
def attempted(drive, made, monkeypatch):
    """Returns what runs a command into a place; to compute anything is an error."""

    def computed(*given, **options):
        raise AssertionError("it has begun")

    monkeypatch.setattr(Log, "select", computed)
    monkeypatch.setattr("roadeval.jobs.results.report.collect", computed)
    monkeypatch.setattr("roadeval.jobs.log_files.pack_messages", computed)
    monkeypatch.setattr("roadeval.jobs.log_files.put", computed)
    monkeypatch.setattr("roadeval.recording.viewer.screenshot", computed)
    return lambda command, place: COMMANDS[command](drive, made, place)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_knows_a_place_that_is_taken_before_it_computes(
    command, attempted, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    ending = {"replay, recording": ".rrd", "replay, mcap": ".mcap"}.get(command, "")
    pipe, within, held = (Path(f"{name}{ending}") for name in ("pipe", "file/new", "held"))
    os.mkfifo(pipe)
    Path("file").touch()
    before = names(tmp_path)
    for path, reason in ((pipe, "is a pipe, not a"), (within, "Not a directory")):
        with pytest.raises(RoadevalError, match=f"^{path}: cannot be.*: {reason}"):
            attempted(command, path)
    own = holding(folder=held) if command == "replay, reports" else holding(held)
    with own, pytest.raises(RoadevalError, match=r"^held.*: another run is writing it"):
        attempted(command, held)
    assert names(tmp_path) == before
