"""Histories of many results: read in their order, judged, and written."""

import json
import shutil

import pytest

from roadeval import compare
from roadeval.jobs.results.history import history
from roadeval.results.history import verdict
from tests.results.fleet.making import SCORED, fleet_of

DAY = 86_400


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Eight runs of six drives; from the sixth on two drives are worse."""
    folder = tmp_path_factory.mktemp("history") / "nights"
    for night in range(8):
        made = folder / f"{night}"
        if night in (0, 5):
            fleet_of(made, 6, change=0.03 * (night >= 5), status=lambda _: SCORED)
        else:
            shutil.copytree(folder / f"{0 if night < 5 else 5}", made)
        summary = made / "fleet.json"
        content = json.loads(summary.read_text())
        origin = {"made_ns": (1000 + night) * DAY * 10**9, "commit": f"{night}" * 40}
        content["origin"] = origin | {"dirty": False, "labels": {"build": f"{night // 2}"}}
        content["run"]["svm"] = {"C": 1.0 + (night >= 5)}
        summary.write_text(json.dumps(content))
    return folder


@pytest.fixture(scope="module")
def made(nights):
    return history(nights)


def test_the_run_that_is_worse_is_named_with_what_changed(made):
    (event,) = made.events
    assert event.run == 5
    assert event.first.line.name == "post.filtered.ERR"
    assert sorted(event.first.drives["drive"][:2]) == ["drive_0000-00000000", "drive_0003-00000003"]
    assert event.reasons == ["commit 444444444444 to 555555555555", "svm.C 1 to 2"]
    assert {drive for drive, _, _ in event.frames} == set(event.first.drives["drive"][:2])
    assert [run.title for run in made.runs][::7] == ["1972-09-27", "1972-10-04"]
    assert "in the run of 1972-10-02 (55555555), on 2 of 6 drives" in verdict(made)


def test_the_base_of_a_comparison_is_the_last_good_run_of_a_folder(made, nights):
    assert made.last_good.paths == (str(nights / "4"),)
    compared = compare([nights, nights / "7"])
    assert [result.label for result in compared.comparison.results] == ["4", "7"]
    assert compared.content["changed"]
