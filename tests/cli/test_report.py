"""The commands that a report names."""

from roadeval.cli.commands.report import commands_of
from roadeval.jobs.results.result import Result
from roadeval.results.fleet import recording_path
from tests.results.fleet.making import fleet_of


def test_a_worst_frame_whose_recording_was_not_kept_opens_where_its_log_is_trusted(tmp_path):
    fleet = fleet_of(tmp_path / "week", 2)
    first = Result(fleet).worst.iloc[0]
    assert commands_of(Result(fleet)).inspect(1).endswith("week --worst 1 --trust-sources")
    kept = recording_path(fleet, first.drive)
    kept.parent.mkdir(exist_ok=True)
    kept.touch()
    assert commands_of(Result(fleet)).inspect(1).endswith("week --worst 1")
