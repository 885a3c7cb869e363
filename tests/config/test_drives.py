"""The configuration of a single drive: its name in paths, and its own settings."""

import pytest

from roadeval.config.run import configure
from roadeval.config.tables import ConfigError


def test_masks_are_those_of_the_drive():
    config = configure({"masks": {"net": {"path": "net/{drive}", "threshold": 0.4}}})
    assert config.for_drive("logs/a.mcap").masks["net"].path == "net/a"
    masks = config.of_drive({"masks": {"net": {"path": "elsewhere"}}}).masks["net"]
    assert (masks.path, masks.threshold) == ("elsewhere", 0.4)


def test_what_holds_for_the_whole_run_is_refused_of_a_drive():
    with pytest.raises(ConfigError, match=r"\[training\] is no table here; choose frames, ground,"):
        configure().of_drive({"training": {}})


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"path": "a", "thresold": 1}, "there is no such setting; choose decide, first"),
        ({"path": "a", "threshold": 2}, "must be at most 1"),
        ({"path": "a", "threshold": 0.5, "labels": {"road": [3]}}, "threshold is for confidence"),
        ({"path": "a", "images": "b", "first": 1}, "with images labels are paired by name"),
    ],
)
def test_bad_masks_are_named(table, message):
    with pytest.raises(ConfigError, match=message):
        configure({"masks": {"net": table}})


def test_masks_without_a_path_are_refused_with_the_drive():
    with pytest.raises(ConfigError, match=r"\[masks.net\] has no path"):
        configure({"masks": {"net": {"threshold": 0.5}}}).for_drive("a.mcap")
