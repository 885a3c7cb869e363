"""Manifests, and what is wrong with some."""

import pytest

from roadeval.config.run import configure
from roadeval.errors import RoadevalError
from roadeval.fleet.drives import find_drives

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


@pytest.fixture
def entries(tmp_path):
    """Find the drives of a manifest from its text."""
    for name in "ab":
        (tmp_path / f"{name}.mcap").touch()

    def read(text):
        path = tmp_path / "fleet.toml"
        path.write_text(text)
        return find_drives([str(path)])

    return read


def test_a_manifest_says_more_of_each_drive(entries, tmp_path):
    first, second = entries(TOML)
    assert (first.path, first.group) == (tmp_path / "a.mcap", "7")
    assert first.tags == {"weather": "rain", "lanes": "2", "wet": "true", "slope": "0.5"}
    assert (second.path, second.description) == (tmp_path / "b.mcap", (None, {}, {}))


def test_settings_of_a_drive_override_those_of_the_run_key_by_key_and_labels_as_a_whole(entries):
    run = configure(
        {
            "topics": {"truth": "/truth"},
            "labels": {"road": [1], "ignore": [2]},
            "frames": {"every": 2, "end": "20"},
        }
    )
    first, second = (entry.config(run) for entry in entries(TOML))
    assert (first.topics.image, first.topics.masks) == ("/left", {"net": "/net"})
    assert first.topics.truth == "/truth"
    assert (first.labels.road, first.labels.ignore) == ((3, 7), ())
    assert (first.frames.start, first.frames.every, first.frames.end) == ("10", 5, "20")
    assert second == run


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("drives = [", r"fleet\.toml: cannot be read as TOML"),
        ("", r"fleet\.toml: a manifest has \[\[drives\]\], one for each drive"),
        ("drives = 3", "one for each drive, and nothing else"),
        ("[frames]\nevery = 2", "one for each drive, and nothing else"),
        ("drives = [3]", "number 1: drives: must be a table"),
        ("[[drives]]\ngroup = 'a'", "number 1: path must name a log"),
        (
            "[[drives]]\npath = 'a'\nwether = 'x'",
            "wether: there is no such setting; choose frames, ground, group",
        ),
        ("[[drives]]\npath = 'a'\ntags = 'x'", "tags: must be a table"),
        ("[[drives]]\npath = 'a'\ntags = { b = [1] }", r"tags\.b: must be text, a number, true or"),
        ("[[drives]]\npath = 'a'\ntags = { 'b c' = 1 }", "a tag's name is made of letters"),
        ("[[drives]]\npath = 'a'\nframes = { evry = 3 }", r"frames\.evry: there is no such"),
        ("[[drives]]\npath = 'a'\nframes = { every = 0 }", r"frames\.every: must be at least 1"),
        ("[[drives]]\npath = 'a'\nlabels = 3", r"labels: must be a table"),
        (
            "[[drives]]\npath = 'a'\nlabels = {ignore = [3]}",
            r"labels\.ignore: needs drives\.labels\.road",
        ),
        ("[[drives]]\npath = 'a'\ntraining = {}", "training: there is no such setting"),
        ('[[drives]]\npath = "a\\u0000"', "holds a zero byte"),
    ],
)
def test_a_wrong_manifest_is_named_in_one_line(entries, text, message):
    with pytest.raises(RoadevalError, match=message) as error:
        entries(text)
    assert "\n" not in str(error.value)
    assert "fleet.toml" in str(error.value)
