"""A comparison on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens.compare import show
from roadeval.evaluation.comparison import DriveChange
from roadeval.report.comparison import NAMED
from tests.evaluation.making import a_change, a_comparison, a_difference

SURE = a_difference(1.2, 1, 2, p_holm=0.01, comparisons=1)


def shown(*changes, judgements=(), **more):
    out = Console(file=io.StringIO(), width=80)
    show(a_comparison(*changes, **more), judgements, out)
    return out.file.getvalue()


def test_the_first_drives_that_changed_are_named_and_the_others_counted():
    def a_drive(place, q):
        about = ("new", "filtered", "post", f"drive {place}", 40, 0.2, 0.19)
        return DriveChange(*about, a_difference(-1, -2, -0.5), q)

    drives = [a_drive(place, 0.0001) for place in range(NAMED + 2)] + [a_drive(99, 0.4)]
    told = shown(a_change(SURE, drives=23), drives=tuple(drives))
    assert "new against base: 23 drives in common\n" in told
    assert "<0.001" in told
    assert f"drive {NAMED - 1} " in told
    assert f"drive {NAMED} " not in told
    assert f"({NAMED} of {NAMED + 2})" in told
