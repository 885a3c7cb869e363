"""``roadeval compare`` and ``roadeval report`` with fleets, as a user runs them."""

import json

import pytest

from tests.e2e.commands import here
from tests.report.making import text
from tests.results.fleet.making import fleet_of

LIMIT = ("--fail-if", "post.filtered.ERR > +0.5pp")


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleets")
    return fleet_of(folder / "base", 10), fleet_of(folder / "new", 10, change=0.03)


def test_a_worse_fleet_ends_with_4_and_the_sentence_that_says_why(fleets):
    run = here("compare", *fleets, *LIMIT)
    assert run.returncode == 4
    assert "new against base: 8 drives scored in both" in run.stdout
    assert "filtered: ERR changed on 3 of 8 drives (worse on 3, better on 0" in run.stdout
    assert "drive_0003" in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 80
    assert "post.filtered.ERR of new changed by" in run.stderr
    assert "warning: 2 drives of base are left out" in run.stderr


def test_a_limit_that_is_kept_ends_with_0_and_is_told(fleets):
    run = here("compare", *fleets, "--fail-if", "post.filtered.ERR > 50%")
    assert run.returncode == 0
    assert "post.filtered.ERR > 50% does not hold" in run.stdout


def test_the_files_are_written_by_their_endings(fleets, tmp_path):
    names = [tmp_path / f"change.{ending}" for ending in ("pdf", "md", "json")]
    run = here("compare", *fleets, *(word for name in names for word in ("-o", name)), "-q", *LIMIT)
    assert (run.returncode, run.stdout) == (4, "")
    document, markdown, content = (name.read_bytes() for name in names)
    told = json.loads(content)
    assert told["format"]["name"] == "roadeval-fleet-comparison"
    assert told["verdict"] == json.loads(here("compare", *fleets, "--json").stdout)["verdict"]
    assert "**FAIL**" in markdown.decode()
    assert "Which drives changed" in text(document)


def test_what_cannot_be_done_is_one_line(fleets, tmp_path):
    for words, said in (
        ((fleets[0], tmp_path), "is a fleet and"),
        ((fleets[0],), "two fleets can be compared, not 1"),
        ((*fleets, "--fail-if", "post.net.ERR > 1pp"), "nothing compared is called post.net"),
        (
            (*fleets, "--fail-if", "post.filtered.ERR > 9pp surely", "--variant", "blind"),
            "post.fil",
        ),
    ):
        run = here("compare", *words)
        assert run.returncode == 1
        assert said in run.stderr
        assert len(run.stderr.splitlines()) == 1


def test_a_fleets_report_is_named(fleets, tmp_path):
    run = here("report", fleets[0], "-o", tmp_path / "fleet.pdf")
    assert (run.returncode, run.stdout) == (0, f"{tmp_path / 'fleet.pdf'}\n")
    assert "What the filter changes" in text((tmp_path / "fleet.pdf").read_bytes())
