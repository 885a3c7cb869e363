"""Facts written and read back."""

import json
import math
from dataclasses import replace

import pytest

from roadeval.results.facts import Facts, LogFacts, digest_of
from roadeval.results.tables import ResultsError
from tests.evaluation.test_scoreboard import effects_of
from tests.results.making import facts_of

NAMES = ("filtered", "unfiltered", "net", "net_tuned", "blind")
TOTALS = {name: {"post": {"ERR": 0.1, "frames": 100}} for name in NAMES}
EFFECTS = effects_of({(name, "post"): [3] * 12 for name in NAMES})
WRITTEN = facts_of(
    totals=TOTALS,
    claims={"filter_ERR": {"held": 2}},
    run={"output": {"save": "out.rrd"}, "evaluation": {"window": 7, "from_the_future": 1}},
    log=LogFacts("street.mcap", "abc"),
    effects=EFFECTS,
)


def changed(**parts):
    """The text of a summary with other parts, under the digest of the first ones."""
    return json.dumps(json.loads(WRITTEN.text()) | parts)


def sealed(content):
    digest = digest_of(content, content["digest"]["parts"])
    return json.dumps(content | {"digest": digest})


def test_what_is_read_is_what_was_written():
    assert Facts.parse(WRITTEN.text(), "here") == WRITTEN
    assert Facts.parse(WRITTEN.text(), "here").effects == EFFECTS


def test_undefined_numbers_are_null_and_read_as_undefined():
    (effect,) = (e for e in EFFECTS if (e.base, e.variant) == ("unfiltered", "filtered"))
    nothing = replace(effect.rates["ERR"], mean=math.nan, units=0)
    facts = replace(WRITTEN, effects=[replace(effect, rates={"ERR": nothing})])
    written = json.loads(facts.text())
    assert written["difference"]["post"]["ERR"]["mean"] is None
    (read,) = Facts.parse(facts.text(), "here").effects
    assert math.isnan(read.rates["ERR"].mean)
    assert replace(read.rates["ERR"], mean=0) == replace(nothing, mean=0)


def test_each_difference_is_under_what_is_subtracted_too():
    content = json.loads(WRITTEN.text())
    assert [*content["difference"]] == ["post"]
    parts = {part: [*content[f"against_{part}"]] for part in ("unfiltered", "blind", "method")}
    assert parts == {
        "unfiltered": ["net", "net_tuned"],
        "blind": ["filtered", "unfiltered", "net", "net_tuned"],
        "method": ["net_tuned"],
    }


@pytest.mark.parametrize("given", [{"confidence": 2}, {"window": None}, 5, None])
def test_damaged_settings_are_one_line(given):
    with pytest.raises(ResultsError, match=r"`run.evaluation` is not what it must be"):
        _ = facts_of(run={"evaluation": given}).evaluation


@pytest.mark.parametrize(
    ("summary", "told"),
    [
        (
            {"format": {**Facts.FORMAT, "version": 1}},
            "made by an earlier version of roadeval, whose format",
        ),
        (
            {"format": {**Facts.FORMAT, "version": 2}, "versions": {"roadeval": "0.2.0"}},
            "made by roadeval 0.2.0, whose format",
        ),
        ({"format": {**Facts.FORMAT, "version": 99}}, "made by a later version: update roadeval"),
        ({"format": {**Facts.FORMAT, "version": "x"}}, "not of format roadeval-summary"),
        ([3], "not of format roadeval-summary"),
    ],
)
def test_a_summary_of_another_format_is_refused_with_who_wrote_it(summary, told):
    with pytest.raises(ResultsError) as caught:
        Facts.parse(json.dumps(summary), "old.rrd")
    assert str(caught.value).startswith(f"old.rrd: {told}")


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("totals", {"blind": 5}),
        ("totals", {"filtered": {"post": None}}),
        ("seconds", {"filtered": 1.5}),
        ("settings", -1),
        ("tables", {"frames": 1.5}),
        ("run", []),
        ("drive", {}),
        ("frames", {"evaluated": "many"}),
        ("difference", {"post": {"ERR": {"mean": "high"}}}),
        ("cameras", []),
        ("cameras", {"left": "no facts"}),
    ],
)
def test_a_part_of_another_shape_is_damage(part, value):
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        Facts.parse(changed(**{part: value}), "here")


@pytest.mark.parametrize("part", ["verdict", "frames", "totals", "difference"])
def test_a_part_that_is_not_there_is_named(part):
    content = json.loads(WRITTEN.text())
    del content[part]
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        Facts.parse(json.dumps(content), "here")


def test_a_number_that_was_changed_is_damage():
    other = {**TOTALS, "filtered": {"post": {"ERR": 0.3, "frames": 100}}}
    with pytest.raises(ResultsError, match=r"here: damaged \(its content is not what was"):
        Facts.parse(changed(totals=other), "here")
    content = json.loads(WRITTEN.text())
    del content["claims"]
    with pytest.raises(ResultsError, match="here: damaged"):
        Facts.parse(json.dumps(content), "here")


def test_where_files_lie_may_change():
    moved = Facts.parse(changed(run={"output": {"save": "elsewhere.rrd"}}), "here")
    assert moved.run["output"]["save"] == "elsewhere.rrd"


@pytest.mark.parametrize("digest", ["x", {}, {"parts": 5, "sha256": ""}, {"parts": [[]]}])
def test_a_damaged_digest_is_damage(digest):
    with pytest.raises(ResultsError, match="here: damaged"):
        Facts.parse(changed(digest=digest), "here")


def test_parts_that_a_later_version_covers_are_checked_by_this_one():
    content = json.loads(WRITTEN.text()) | {"new": [1, 2]}
    content["digest"]["parts"].append("new")
    assert Facts.parse(sealed(content), "here") == WRITTEN
    with pytest.raises(ResultsError, match="damaged"):
        Facts.parse(json.dumps(json.loads(sealed(content)) | {"new": [1, 3]}), "here")
