"""Summaries read back, those of version 1 too."""

import json
import math
from pathlib import Path

import pytest

from roadeval.results.reading import ResultsError
from roadeval.results.summary import (
    FORMAT,
    RESULTS,
    digest_of,
    json_text,
    parse_summary,
    plain,
)


def test_a_summary_of_version_1_takes_todays_shape():
    own = {"preset": "paper", "svm": {"c": 1.0}, "training": {"frames": 10}, "evaluation": {}}
    old = {
        "format": {**FORMAT, "version": 1},
        "totals": {},
        "selection": {"image_topic": "/camera", "road_labels": [3], "scale": 0.5},
        "settings": {"filtered": own, "unfiltered": own},
    }
    summary = parse_summary(json.dumps(old), "old.rrd")
    assert summary["format"] == FORMAT
    assert "selection" not in summary
    assert summary["settings"] == {name: {"svm": {"c": 1.0}} for name in old["settings"]}
    assert summary["run"] == {
        "preset": "paper",
        "topics": {"image": "/camera"},
        "labels": {"road": [3]},
        "frames": {"scale": 0.5},
        "output": {},
        "training": {"frames": 10},
        "evaluation": {},
    }


def test_what_version_2_said_of_differences_is_left_out_for_the_tables_tell():
    old = {"format": {**FORMAT, "version": 2}, "verdict": "Cannot tell.", "difference": {}}
    assert parse_summary(json.dumps(old | {"totals": {}}), "old.rrd") == {
        "format": FORMAT,
        "totals": {},
    }


@pytest.mark.parametrize("version", [0, 4, None])
def test_another_version_is_refused_where_it_lies(version):
    text = json.dumps({"format": {**FORMAT, "version": version}})
    with pytest.raises(ResultsError, match=r"^new\.rrd: not a summary of format"):
        parse_summary(text, "new.rrd")


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
    text = json.dumps({"format": FORMAT, part: value})
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


def test_where_files_lie_may_change_and_earlier_versions_have_no_digest():
    sealed = WRITTEN | {"digest": digest_of(WRITTEN, RESULTS)}
    moved = sealed | {"run": {"output": {"save": "elsewhere.rrd"}}}
    assert parse_summary(json.dumps(moved), "here") == moved
    assert parse_summary(json.dumps(WRITTEN).replace("0.1", "0.3"), "here")["totals"]


def test_a_digest_is_that_of_what_json_gives_back():
    written = {"totals": {"a": (1, math.nan, Path("b"), 1 / 3, "\u00e9\udce9")}, "run": 5}
    read = json.loads(json_text(plain(written)))
    assert digest_of(written, ("totals",)) == digest_of(read, ("totals", "other"))


def test_a_damaged_digest_is_damage_and_another_format_is_told_as_such():
    for digest in ("x", {}, {"parts": 5, "sha256": ""}, {"parts": [[]], "sha256": ""}):
        with pytest.raises(ResultsError, match="here: damaged"):
            parse_summary(json.dumps(WRITTEN | {"digest": digest}), "here")
        later = {"format": {**FORMAT, "version": 4}, "digest": digest}
        with pytest.raises(ResultsError, match="not a summary of format"):
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
    with pytest.raises(ResultsError, match="here: damaged"):
        parse_summary(text, "here")
