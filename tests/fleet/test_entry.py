"""Drives dealt into folds."""

from pathlib import Path

import pytest

from roadeval.fleet.drives import FleetError, deal, entry_of, groups_of
from roadeval.logs.container.records import MAGIC

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
