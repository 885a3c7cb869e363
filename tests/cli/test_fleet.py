"""``roadeval fleet`` in a terminal."""

import pytest

from roadeval.cli.app import main


@pytest.mark.parametrize(("words", "again"), [((), False), (("--retry-failed",), True)])
def test_what_failed_is_tried_again_only_where_that_is_asked_for(words, again, monkeypatch, capsys):
    given = {}

    def stopped(*_, **options):
        given.update(options)
        raise KeyboardInterrupt

    monkeypatch.setattr("roadeval.jobs.run.fleet.replay_fleet", stopped)
    assert main(["fleet", "drives", "-o", "out", "--quiet", *words]) == 130
    assert given["retry_failed"] is again
