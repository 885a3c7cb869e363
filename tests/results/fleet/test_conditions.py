"""Conditions on the drives of a fleet, and the case that CI shows of each."""

from xml.etree import ElementTree

import pytest

from roadeval import Result
from roadeval.evaluation.comparison import Condition, ConditionError
from roadeval.results.comparison import junit_xml
from roadeval.results.over_drives import (
    check_conditions,
    drive_cases,
    judge_drives,
    scores_of,
)
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "monday"
    fleet_of(folder, 9, 0)
    return Result(folder)


def errors(fleet):
    rows = fleet.scores.query("variant == 'filtered' and stage == 'post' and region == 'all'")
    return dict(zip(rows["drive"], rows["ERR"], strict=True))


def test_a_condition_holds_on_the_drives_that_are_above_it(fleet):
    rates = errors(fleet)
    limit = round(100 * sorted(rates.values())[4], 3)
    condition = Condition.parse(f"post.filtered.ERR > {limit}%")
    found = {
        each.result: each.holds for each in judge_drives(scores_of(fleet.paths[0]), [condition], 10)
    }
    assert found == {drive: 100 * rate > limit for drive, rate in rates.items()}
    assert {*found.values()} == {True, False}


def test_a_drive_of_few_frames_is_not_judged(fleet):
    condition = Condition.parse("post.filtered.ERR > 0%")
    found = [*judge_drives(scores_of(fleet.paths[0]), [condition], 1000)]
    assert [each.holds for each in found] == [None] * len(errors(fleet))
    assert "1000 are needed" in found[0].why


def test_a_mask_that_is_not_there_is_named_with_those_that_are(fleet):
    condition = Condition.parse("post.nobody.ERR > 0%")
    with pytest.raises(
        ConditionError, match=r"nothing scored is called post\.nobody; .*post\.filtered"
    ):
        [*judge_drives(scores_of(fleet.paths[0]), [condition], 10)]


def test_a_change_has_no_base():
    with pytest.raises(ConditionError, match="has no base"):
        check_conditions([Condition.parse("post.filtered.ERR > +0.5pp")])


def test_a_condition_that_holds_is_a_failed_case(fleet):
    every = Condition.parse("post.filtered.ERR >= 0%")
    none = Condition.parse("post.filtered.ERR > 100%")
    judged = [*judge_drives(scores_of(fleet.paths[0]), [every, none], 10)]
    suite = ElementTree.fromstring(junit_xml("monday", drive_cases((), judged)))
    assert suite.get("failures") == str(len(errors(fleet)))
    assert suite.get("tests") == str(2 * len(errors(fleet)))
    failed = {case.get("classname") for case in suite if case.find("failure") is not None}
    assert failed == {every.text}
