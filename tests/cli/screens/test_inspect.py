"""The list of the worst frames on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens import inspect
from roadeval.jobs.results.inspect import WorstFrame

FRAME = WorstFrame(
    rank=1,
    drive="street",
    frame=39,
    stamp_ns=0,
    variant="net",
    stage="post",
    rates={"ERR": 0.25, "FPR": 0.125, "FNR": float("nan")},
    parts={"svm": 0.2, "filter": 0.07, "post": -0.02},
    notes=("net fails.",),
)


def test_the_list_says_whose_frames_these_are_and_where_their_error_comes_from():
    out = Console(file=io.StringIO(), width=80)
    inspect.show("street", [FRAME], out)
    title, _, head, _, row, *_ = out.file.getvalue().splitlines()
    assert title == "street: worst frames of net by ERR of post (of neighbours only the worst)"
    assert head.split() == ["frame", "ERR", "%", "FPR", "%", "FNR", "%", "why"]
    why = "svm 20.0, filter +7.0, post -2.0 pp. Fails."
    assert " ".join(row.split()) == f"1 39 25.00 12.50 - {why}"
