"""Which drives words name: logs, folders, globs, URLs, manifests; and the folds of them."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from roadeval import RoadevalError, RunConfig, configure
from roadeval.data import is_plain
from roadeval.fleet.drives import (
    DriveEntry,
    FleetError,
    deal,
    entry_of,
    find_drives,
    groups_of,
    identity,
)
from roadeval.geometry.settings import GroundSettings
from roadeval.logs.container.records import MAGIC
from roadeval.logs.settings import CameraSettings
from tests.fixtures.elsewhere import split_bag, talker

LOG = talker(3).bytes()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, and the current one."""
    folder = tmp_path.resolve() / "drives"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def put(*names: str | Path, content: bytes = LOG) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(content)


def put_bag(folder: Path) -> None:
    for name, content in split_bag().items():
        put(folder / name, content=content)


def manifest(name: str, *drives: str) -> None:
    """Write a manifest; an argument has the lines of a drive."""
    Path(f"{name}.toml").write_text("".join(f"[[drives]]\n{lines}\n" for lines in drives))


def sources(*words: str | Path) -> list[str]:
    """Return the paths of the drives that words name, below the current folder."""
    return [os.path.relpath(entry.source) for entry in find_drives([str(w) for w in words])]


def test_a_file_of_any_name_is_a_drive(folder):
    put("a.mcap", "b.log", "no_suffix")
    assert sources("b.log", "no_suffix", folder / "a.mcap") == ["b.log", "no_suffix", "a.mcap"]


@pytest.mark.parametrize("name", ["\u202e!?", "-rf", "..", "x" * 200, "a\nb", "ü", "\udcff"])
def test_an_identity_is_plain_and_short_whatever_the_name(folder, name):
    put(f"{name}.mcap")
    (entry,) = find_drives([f"{name}.mcap"])
    assert is_plain(entry.id)
    assert entry.id[0] not in "-_"
    assert len(entry.id) <= 53
    assert entry.name.isprintable()


def test_a_folder_is_searched_through_in_natural_order(folder):
    put("d/drive_10.mcap", "d/drive_2.mcap", "d/b/1.mcap", "d/note.txt", "d/LOUD.MCAP")
    assert sources("d") == ["d/LOUD.MCAP", "d/b/1.mcap", "d/drive_2.mcap", "d/drive_10.mcap"]


def test_hidden_and_incomplete_files_are_left_out_of_a_search(folder):
    put("d/a.mcap", "d/.b.mcap", "d/.c/c.mcap", "d/e.5d1c02fe.partial.mcap", "d/lost+found/f.mcap")
    assert sources("d") == ["d/a.mcap"]
    assert sources("d/*.mcap") == ["d/a.mcap"]
    assert sources("d/.b.mcap") == ["d/.b.mcap"]


def test_a_split_bag_is_one_drive_in_a_search_and_by_itself(folder):
    put("d/a.mcap")
    put_bag(folder / "d/run")
    assert sources("d") == ["d/a.mcap", "d/run"]
    assert sources("d/run") == ["d/run"]
    assert [entry.name for entry in find_drives(["d/run"])] == ["run"]


@pytest.mark.parametrize(
    "words", [["d/run/*.mcap"], ["d/**/*.mcap"], ["d/run", "d/run/bag_1.mcap"]]
)
def test_files_of_a_bag_are_the_bag(folder, words):
    put_bag(folder / "d/run")
    assert sources(*words) == ["d/run"]


def test_a_folder_that_is_linked_twice_is_searched_once(folder):
    put("d/real/a.mcap")
    (folder / "d/real/again").symlink_to(folder / "d")
    (folder / "d/zlink").symlink_to(folder / "d/real")
    assert sources("d") == ["d/real/a.mcap"]


def test_a_glob_matches_files_and_folders(folder):
    put("d/1/a.mcap", "d/2/b.mcap", "d/2/c/d.mcap", "d/2/x.log", "e[1].mcap")
    assert sources("d/*/*.mcap") == ["d/1/a.mcap", "d/2/b.mcap"]
    assert sources("d/**/*.mcap") == ["d/1/a.mcap", "d/2/b.mcap", "d/2/c/d.mcap"]
    assert sources("d/*") == ["d/1/a.mcap", "d/2/b.mcap", "d/2/c/d.mcap"]
    assert sources("d/2/*") == ["d/2/b.mcap", "d/2/c/d.mcap"]
    assert sources("d/2/*.log") == ["d/2/x.log"]
    assert sources("e[1].mcap") == ["e[1].mcap"]


def test_a_manifest_says_more_of_a_drive_that_is_named_beside_it(folder):
    put("a.mcap", "b.mcap")
    manifest("fleet", 'path = "b.mcap"\ngroup = "tuesday"\nframes = { every = 5 }')
    for words in (["a.mcap", "b.mcap", "fleet.toml"], ["a.mcap", "fleet.toml", "b.mcap"]):
        first, second = find_drives(words)
        assert (first.group, second.group) == (None, "tuesday")
        assert second.settings == {"frames": {"every": 5}}


def test_cameras_that_are_asked_for_are_those_of_each_drive_that_names_none(folder):
    cameras = (
        CameraSettings("/front", truth="/front/labels", ground=GroundSettings(height=1.5)),
        CameraSettings("/rear", truth=""),
    )
    bare, table = DriveEntry("a.mcap", "a", "a"), {"topics": {"image": "/top"}, "labels": {}}
    front, rear = bare.of_cameras(cameras)
    assert front.settings["topics"] == {"image": "/front", "truth": "/front/labels"}
    assert front.config(RunConfig()).ground.height == 1.5
    assert rear.config(RunConfig()).topics.truth == ""
    drive = replace(bare, settings=table)
    assert [*drive.of_cameras(cameras)] == [drive]


def test_a_log_may_be_named_once_for_each_of_its_cameras(folder):
    put("a.mcap")
    put("b.mcap")
    cameras = [f'path = "a.mcap"\ntopics.image = "/{side}/image"' for side in ("front", "rear")]
    manifest("rig", *cameras, 'path = "b.mcap"')
    front, rear, other = find_drives(["rig.toml"])
    assert (front.camera, rear.camera, other.camera) == ("/front/image", "/rear/image", "")
    assert (front.name, rear.name, other.name) == ("a front", "a rear", "b")
    assert front.id.startswith(f"{identity(front.source)}-front-")
    assert is_plain(front.id)
    assert front.id != rear.id
    assert find_drives(["rig.toml", "rig.toml"]) == [front, rear, other]


def test_two_descriptions_of_one_drive_are_refused(folder):
    put("a.mcap")
    for name, weather in (("1", "rain"), ("2", "sun")):
        manifest(name, f'path = "a.mcap"\ntags.weather = "{weather}"')
    assert len(find_drives(["1.toml", "1.toml"])) == 1
    with pytest.raises(
        RoadevalError, match=r"a\.mcap: is named twice, with different groups, tags"
    ):
        find_drives(["1.toml", "2.toml"])


def test_paths_of_a_manifest_are_relative_to_it(folder):
    put("m/logs/1.mcap", "m/logs/2.mcap", "m/x.mcap")
    Path("m/fleet.toml").write_text(
        '[[drives]]\npath = "logs/*.mcap"\ngroup = "g"\n\n[[drives]]\npath = "s3://bucket/k.mcap"\n'
    )
    first, second, url = find_drives(["m/fleet.toml"])
    assert (first.path, second.path) == (folder / "m/logs/1.mcap", folder / "m/logs/2.mcap")
    assert (first.group, second.group, url.group) == ("g", "g", None)
    assert (url.source, url.path, url.name) == ("s3://bucket/k.mcap", None, "k")


def test_what_shows_an_entry_shows_no_secret():
    (entry,) = find_drives(["https://me:a@geheim@host/a.mcap?sig=geheim"])
    assert "geheim" in entry.source
    assert entry.shown == "https://host/a.mcap"
    assert "geheim" not in f"{entry!r} {entry.shown} {entry.id} {entry.name}"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("gone.mcap", r"gone\.mcap: there is no such file or folder"),
        ("gone/*.mcap", r"gone/\*\.mcap: no log matches it"),
        ("empty", r"empty: a folder without \*\.mcap files"),
        ("bags", r"bags: no \*\.mcap file in it; a\.bag is a ROS 1 bag: mcap convert"),
        ("unfinished", "unfinished: no log that is complete"),
        ("ftp://host/a.mcap", r"ftp://host/a\.mcap: an unknown scheme; choose s3://, gs://"),
        ("file:///a.mcap", r"file:///a\.mcap: an unknown scheme"),
        ("gone.toml", "there is no such file or folder"),
        ("x" * 300, "File name too long"),
    ],
)
def test_a_word_that_names_no_drive_is_an_error_of_one_line(folder, word, message):
    Path("empty").mkdir()
    put("bags/a.bag", "unfinished/.hidden.mcap", "m.toml")
    Path("bags/a.bag").write_bytes(b"#ROSBAG V2.0\n")
    Path("unfinished/a.5d1c02fe.partial.mcap").write_bytes(LOG)
    with pytest.raises(RoadevalError, match=message) as error:
        find_drives([word])
    assert "\n" not in str(error.value)


DRIVES = {f"drive{k}": f"day{k // 3}" for k in range(30)}


def test_drives_of_a_group_stay_together():
    folds = deal(DRIVES, 4, seed=0)
    for day in set(DRIVES.values()):
        assert len({folds[drive] for drive, group in DRIVES.items() if group == day}) == 1


def test_folds_have_the_same_number_of_groups_but_for_one():
    folds = deal({f"d{k}": f"d{k}" for k in range(23)}, 5, seed=1)
    sizes = [list(folds.values()).count(k) for k in range(5)]
    assert sorted(sizes) == [4, 4, 5, 5, 5]


def test_the_deal_depends_on_the_seed_and_not_on_the_order():
    backwards = dict(reversed(DRIVES.items()))
    assert deal(DRIVES, 3, seed=0) == deal(backwards, 3, seed=0)
    assert deal(DRIVES, 3, seed=0) != deal(DRIVES, 3, seed=1)


def test_fewer_groups_than_folds_are_refused():
    with pytest.raises(FleetError, match=r"11 folds need as many drives .* there are 10"):
        deal(DRIVES, 11, seed=0)


# --- Copies of one log are of one group, whatever they are called ---------------------------------


def drive(folder: Path, name: str, content: bytes, group: str | None = None):
    path = folder / name
    path.write_bytes(MAGIC + content)
    return entry_of(str(path), group)


def test_copies_share_a_group_and_logs_of_the_same_size_do_not(tmp_path):
    one, other = drive(tmp_path, "a.mcap", b"same"), drive(tmp_path, "b.mcap", b"same")
    alone = drive(tmp_path, "c.mcap", b"else")
    assert groups_of([one, other, alone]) == {one.id: one.id, other.id: one.id, alone.id: alone.id}


def test_groups_that_hold_copies_of_one_log_are_one(tmp_path):
    entries = [
        drive(tmp_path, "a.mcap", b"same", "monday"),
        drive(tmp_path, "b.mcap", b"b", "monday"),
        drive(tmp_path, "c.mcap", b"same", "tuesday"),
        drive(tmp_path, "d.mcap", b"dd", "tuesday"),
        drive(tmp_path, "e.mcap", b"eee", "friday"),
    ]
    assert [*groups_of(entries).values()] == [*["monday"] * 4, "friday"]


def test_what_cannot_be_read_and_what_lies_elsewhere_stands_alone(tmp_path):
    entries = [
        entry_of(str(tmp_path / "missing.mcap")),
        entry_of("https://example.org/a.mcap"),
        entry_of("https://example.org/b.mcap"),
    ]
    assert groups_of(entries) == {entry.id: entry.id for entry in entries}


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
