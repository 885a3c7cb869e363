"""What is asked of single drives, in place of what is asked of all."""

from pathlib import Path

import pytest

from roadeval.config import ConfigError, configure, load_config

CODES = {"road": [3], "ignore": [11]}


def of(drive: str | Path, *entries, **tables):
    """The configuration of one drive."""
    return configure({"drives": entries, **tables}).for_drive(drive)


@pytest.mark.parametrize(
    "path",
    ["monday.mcap", "logs/monday.mcap", "mon*.mcap", "logs/*.mcap", "*.mcap", "logs/../logs/*day*"],
)
def test_a_drive_is_named_by_its_path_or_the_end_of_it(path, tmp_path, monkeypatch):
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    entry = {"path": path, "labels": CODES}
    typed = "logs/../logs/monday.mcap" if ".." in path else "logs/monday.mcap"
    assert of(typed, entry).labels.road == (3,)
    assert of(tmp_path / "logs" / "monday.mcap", {**entry, "path": typed}).labels.road == (3,)


def test_a_link_is_known_by_its_own_name_and_a_folder_from_within_by_its(tmp_path, monkeypatch):
    (tmp_path / "bag").mkdir()
    (tmp_path / "today.mcap").symlink_to(tmp_path / "2013-05-01.mcap")
    monkeypatch.chdir(tmp_path / "bag")
    for drive, path in (("../today.mcap", "today.mcap"), (".", "bag")):
        assert of(drive, {"path": path, "labels": CODES}).labels.road == (3,)


@pytest.mark.parametrize("path", ["tuesday.mcap", "monday", "onday.mcap", "other/monday.mcap"])
def test_another_drive_keeps_what_holds_for_all(path):
    config = of("logs/monday.mcap", {"path": path, "labels": CODES})
    assert config == configure()


def test_labels_take_the_place_of_all_labels_and_the_rest_is_overridden_key_by_key():
    config = of(
        "a.mcap",
        {"path": "a.mcap", "labels": {"road_colors": [[1, 2, 3]]}, "frames": {"start": "2"}},
        labels=CODES,
        frames={"every": 5},
    )
    assert (config.labels.road, config.labels.road_colors) == ((), ((1, 2, 3),))
    assert (config.frames.start, config.frames.every) == ("2", 5)


def test_empty_labels_leave_a_mask_to_be_understood_by_itself():
    assert of("a.mcap", {"path": "a.mcap", "labels": {}}, labels=CODES).labels.road == ()


def test_a_later_entry_overrides_an_earlier_one():
    entries = [{"path": "*.mcap", "topics": {"image": "/left", "truth": "/t"}}]
    config = of("a.mcap", *entries, {"path": "a.mcap", "topics": {"image": "/right"}})
    assert (config.topics.image, config.topics.truth) == ("/right", "/t")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("drives = 3", "drives must be tables, each under [[drives]]"),
        ("[drives]\npath = 'a'", "drives must be tables, each under [[drives]]"),
        ("[[drives]]\nlabels = {}", "[[drives]]: path must name a log, or several as *.mcap"),
        ("[[drives]]\npath = ''", "[[drives]]: path must name a log, or several as *.mcap"),
        (
            "[[drives]]\npath = 'a'\ntraining = {}",
            "[[drives]] a: [training] is no table here; choose frames, ground, labels, masks",
        ),
        ("[[drives]]\npath = 'a'\nroad = 3", "[[drives]] a: road is in no table"),
        ("[[drives]]\npath = 'a'\nlabels = 3", "[[drives]] a: labels: must be a table"),
        (
            "[[drives]]\npath = 'a'\nlabels = {road = [3, -1]}",
            "[[drives]] a: labels.road, item 2: must be at least 0",
        ),
        (
            "[[drives]]\npath = 'a'\nlabels = {ignore = [3]}",
            "[[drives]] a: labels.ignore needs labels.road",
        ),
    ],
)
def test_a_bad_entry_is_named(tmp_path, text, message):
    file = tmp_path / "c.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert str(caught.value).startswith(f"{file}: {message}")


def test_masks_are_those_of_the_drive():
    config = configure({"masks": {"net": {"path": "net/{drive}", "threshold": 0.4}}})
    entry = {"path": "b.mcap", "masks": {"net": {"path": "elsewhere"}}}
    config = config.override({"drives": [entry]})
    assert config.for_drive("logs/a.mcap").masks["net"].path == "net/a"
    assert config.for_drive("logs/b.mcap").masks["net"].path == "elsewhere"
    assert config.for_drive("logs/b.mcap").masks["net"].threshold == 0.4


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


def test_masks_and_a_variant_cannot_share_a_name():
    with pytest.raises(ConfigError, match="'net': the name is taken"):
        configure({"variants": {"net": {"preset": "gated"}}, "masks": {"net": {"path": "a"}}})
