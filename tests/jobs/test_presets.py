"""The table of the presets' benchmark."""

import numpy as np

from benchmarks.presets import not_below, print_table

UNLABELLED = [0, 0, 0, 0, 0, 0]
BLIND = np.array([[5, 3, 1, 1, 4, 2], [2, 2, 3, 3, 4, 2], UNLABELLED])
UNFILTERED = np.array([[5, 3, 2, 0, 4, 1], [4, 4, 1, 1, 4, 1], UNLABELLED])


def test_a_drive_without_a_defined_err_does_not_count():
    assert not_below(UNFILTERED, BLIND) == "1 of 2"


def test_blind_is_not_compared_with_itself(capsys):
    print_table({"blind": BLIND[:2], "unfiltered": UNFILTERED[:2]})
    _, blind, unfiltered = capsys.readouterr().out.splitlines()
    assert blind.split()[:4] == ["blind", "40.00", "50.0", "-"]
    assert unfiltered.split()[:6] == ["unfiltered", "20.00", "25.0", "1", "of", "2"]
