"""Summaries read back, those of version 1 too."""

import json

import pytest

from roadeval.results.reading import ResultsError
from roadeval.results.summary import FORMAT, parse_summary


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
