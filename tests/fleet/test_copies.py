"""Copies of one log are of one group, whatever they are called."""

from pathlib import Path

from roadeval.fleet.entry import entry_of, groups_of
from roadeval.logs.container.records import MAGIC


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


def test_folders_of_the_same_files_are_copies(tmp_path):
    entries = []
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        drive(tmp_path / name, "0.mcap", b"one")
        drive(tmp_path / name, "1.mcap", b"two")
        entries.append(entry_of(str(tmp_path / name)))
    assert len(set(groups_of(entries).values())) == 1


def test_what_cannot_be_read_and_what_lies_elsewhere_stands_alone(tmp_path):
    entries = [
        entry_of(str(tmp_path / "missing.mcap")),
        entry_of("https://example.org/a.mcap"),
        entry_of("https://example.org/b.mcap"),
    ]
    assert groups_of(entries) == {entry.id: entry.id for entry in entries}
