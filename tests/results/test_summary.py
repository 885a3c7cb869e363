"""Summaries read back."""

import json
import math
from pathlib import Path

import pytest

from roadeval.results.summary import (
    FORMAT,
    RESULTS,
    digest_of,
    json_text,
    parse_summary,
    plain,
)
from roadeval.results.tables import ResultsError


@pytest.mark.parametrize(
    ("summary", "told"),
    [
        (
            {"format": {**FORMAT, "version": 1}},
            "made by an earlier version of roadeval, whose format",
        ),
        (
            {"format": {**FORMAT, "version": 2}, "versions": {"roadeval": "0.2.0"}},
            "made by roadeval 0.2.0, whose format",
        ),
        (
            {"format": FORMAT, "versions": {"roadeval": "0.2.0"}},
            "made by roadeval 0.2.0, whose format",
        ),
        (
            {"format": FORMAT, "versions": ["0.2.0"]},
            "made by an earlier version of roadeval, whose",
        ),
        ({"format": {**FORMAT, "version": 5}}, "made by a later version: update roadeval"),
        (
            {"format": {**FORMAT, "version": 9}, "versions": {"roadeval": "9.\n"}},
            r"made by roadeval 9.\n, a later version: update",
        ),
        ({"format": {**FORMAT, "version": "x"}}, "not a summary of roadeval; make it anew"),
        ({"format": {"name": "other", "version": 3}}, "not a summary of roadeval; make it anew"),
        ([3], "not a summary of roadeval; make it anew"),
    ],
)
def test_a_summary_of_another_format_is_refused_with_who_wrote_it(summary, told):
    with pytest.raises(ResultsError) as caught:
        parse_summary(json.dumps(summary), "old.rrd")
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
    ],
)
def test_a_part_of_another_shape_is_damage(part, value):
    text = json.dumps({"format": FORMAT, "digest": {}, part: value})
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        parse_summary(text, "here")


def test_a_text_of_many_brackets_is_no_summary():
    with pytest.raises(ResultsError, match="here: not a summary"):
        parse_summary("[" * 100_000, "here")


WRITTEN = {
    "format": FORMAT,
    "totals": {"filtered": {"post": {"ERR": 0.1, "frames": 100}}},
    "claims": {"filtered": {"post": {}}},
    "run": {"output": {"save": "out.rrd"}},
}


def test_a_number_that_was_changed_is_damage():
    sealed = WRITTEN | {"digest": digest_of(WRITTEN, RESULTS)}
    assert parse_summary(json.dumps(sealed), "here") == sealed
    changed = json.dumps(sealed).replace("0.1", "0.3")
    with pytest.raises(ResultsError, match=r"here: damaged \(its content is not what was"):
        parse_summary(changed, "here")
    lacking = {part: value for part, value in sealed.items() if part != "claims"}
    with pytest.raises(ResultsError, match="here: damaged"):
        parse_summary(json.dumps(lacking), "here")


def test_where_files_lie_may_change():
    sealed = WRITTEN | {"digest": digest_of(WRITTEN, RESULTS)}
    moved = sealed | {"run": {"output": {"save": "elsewhere.rrd"}}}
    assert parse_summary(json.dumps(moved), "here") == moved


def test_a_digest_is_that_of_what_json_gives_back():
    written = {"totals": {"a": (1, math.nan, Path("b"), 1 / 3, "\u00e9\udce9")}, "run": 5}
    read = json.loads(json_text(plain(written)))
    assert digest_of(written, ("totals",)) == digest_of(read, ("totals", "other"))


def test_a_damaged_digest_is_damage_and_another_format_is_told_as_such():
    for digest in ("x", {}, {"parts": 5, "sha256": ""}, {"parts": [[]], "sha256": ""}):
        with pytest.raises(ResultsError, match="here: damaged"):
            parse_summary(json.dumps(WRITTEN | {"digest": digest}), "here")
        later = {"format": {**FORMAT, "version": 5}, "digest": digest}
        with pytest.raises(ResultsError, match="made by a later version"):
            parse_summary(json.dumps(later), "here")


def test_parts_that_a_later_version_covers_are_checked_by_this_one():
    later = WRITTEN | {"new": [1, 2]}
    sealed = later | {"digest": digest_of(later, ("totals", "new"))}
    assert parse_summary(json.dumps(sealed), "here") == sealed
    with pytest.raises(ResultsError, match="damaged"):
        parse_summary(json.dumps(sealed | {"new": [1, 3]}), "here")


def test_a_part_without_end_is_damage():
    deep = 800 * "[" + 800 * "]"
    text = json.dumps(WRITTEN | {"digest": digest_of(WRITTEN, RESULTS)}).replace("0.1", deep)
    with pytest.raises(ResultsError, match=r"here: not a summary .it nests more than"):
        parse_summary(text, "here")
