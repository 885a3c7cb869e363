"""Drives dealt into folds."""

import pytest

from roadeval.fleet.entry import FleetError, deal

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
