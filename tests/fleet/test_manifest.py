"""Manifests in TOML and CSV, and what is wrong with some."""

import pytest

from roadeval.config import RunConfig
from roadeval.errors import RoadevalError
from roadeval.fleet.sources import read_manifest

TOML = """\
[[drives]]
path = "a.mcap"
group = 7
tags = { weather = "rain", lanes = 2, wet = true, slope = 0.5 }
topics = { image = "/left", masks = { net = "/net" } }
labels = { road = [3, 7] }
frames = { start = "10", every = 5 }

[[drives]]
path = "b.mcap"
"""
CSV = """\
path,group,tag.weather,tag.lanes,tag.wet,tag.slope,topics.image,topics.masks.net,labels.road,\
frames.start,frames.every
a.mcap,7,rain,2,true,0.5,/left,/net,3 7,10,5
b.mcap,,,,,,,,,,
"""


@pytest.fixture
def entries(tmp_path):
    """Read a manifest from its text."""

    def read(text, suffix=".toml", encoding="utf-8"):
        path = tmp_path / f"fleet{suffix}"
        path.write_text(text, encoding=encoding)
        return read_manifest(path)

    return read


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize(
    ("text", "suffix"),
    [(TOML, ".toml"), (CSV, ".csv"), (CSV.replace(",", ";"), ".csv"), (CSV, ".CSV")],
)
def test_both_forms_say_the_same(entries, text, suffix, encoding):
    first, second = entries(text, suffix, encoding)
    assert (first.path, first.group) == ("a.mcap", "7")
    assert first.tags == {"weather": "rain", "lanes": "2", "wet": "true", "slope": "0.5"}
    config = RunConfig().with_drives([first.settings]).for_drive("a.mcap")
    assert (config.topics.image, config.topics.masks) == ("/left", {"net": "/net"})
    assert config.labels.road == (3, 7)
    assert (config.frames.start, config.frames.every) == ("10", 5)
    assert (second.path, second.group, second.tags, second.settings) == ("b.mcap", None, {}, None)


def test_a_cell_is_a_number_only_where_one_can_be(entries):
    text = "path,group,tag.id,topics.image,topics.truth,topics.resize_truth,labels.road_colors\n"
    (entry,) = entries(f'{text}12,7.50,0012,true,5,true,"[[1, 2, 3]]"\n', ".csv")
    assert (entry.path, entry.group, entry.tags) == ("12", "7.50", {"id": "0012"})
    tables = entry.settings.tables
    assert tables["topics"] == {"image": "true", "truth": "5", "resize_truth": True}
    assert tables["labels"]["road_colors"] == [[1, 2, 3]]


def test_quoted_cells_and_empty_lines_are_read(entries):
    (entry,) = entries('path,tag.place\n\n"a, b.mcap","Berlin, ""Mitte"""\n,\n', ".csv")
    assert (entry.path, entry.tags) == ("a, b.mcap", {"place": 'Berlin, "Mitte"'})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("drives = [", r"fleet\.toml: cannot be read as TOML"),
        ("", r"fleet\.toml: names no drive"),
        ("drives = 3", "drives must be tables"),
        ("[frames]\nevery = 2", "frames: a manifest has only"),
        ("[[drives]]\ngroup = 'a'", "number 1: path must name a log"),
        (
            "[[drives]]\npath = 'a'\nwether = 'x'",
            "wether: there is no such key; choose path, group",
        ),
        ("[[drives]]\npath = 'a'\ntags = 'x'", "tags must be a table"),
        ("[[drives]]\npath = 'a'\ntags = { b = [1] }", "tag b: must be text, a number, true or"),
        ("[[drives]]\npath = 'a'\ntags = { 'b c' = 1 }", "tag 'b c': a tag's name is made of"),
        ("[[drives]]\npath = 'a'\nframes = { evry = 3 }", r"frames\.evry: there is no such"),
        ("[[drives]]\npath = 'a'\nframes = { every = 0 }", r"frames\.every: must be at least 1"),
        ("[[drives]]\npath = 'a'\ntraining = {}", "training: there is no such key"),
    ],
)
def test_a_wrong_manifest_in_toml_is_named_in_one_line(entries, text, message):
    with pytest.raises(RoadevalError, match=message) as error:
        entries(text)
    assert "\n" not in str(error.value)
    assert "fleet.toml" in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column is called 'path'; choose path, group, tag.KEY, topics.KEY"),
        ("path\n", "names no drive"),
        ("path,weather\na,rain", "no column can be called 'weather'; choose path, group, tag.KEY"),
        ("path,training.seed\na,1", "no column can be called 'training.seed'"),
        ("path,path\na,b", "two columns are called 'path'"),
        ("path,group\na", "line 2: 1 cells below 2 columns"),
        ("path,group\n,b", "line 2: path must name a log"),
        ("path,frames.every\na,often", r"line 2, a: frames\.every: must be a whole number"),
        ('path\n"a', "cannot be read as CSV"),
    ],
)
def test_a_wrong_manifest_in_csv_is_named_in_one_line(entries, text, message):
    with pytest.raises(RoadevalError, match=message) as error:
        entries(text, ".csv")
    assert "\n" not in str(error.value)
    assert "fleet.csv" in str(error.value)
