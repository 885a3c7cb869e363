"""Arguments of functions that the command line would refuse."""

import pytest

import roadeval
from roadeval import RoadevalError

CALLS = {
    "count must be a whole number from 1 on": lambda: roadeval.pick("no.rrd", 0, "out"),
    "count must be a whole number from 1 on (": lambda: roadeval.pick("no.rrd", 2.5, "out"),
    "seed must be": lambda: roadeval.pick("no.rrd", 2, "out", seed=-1),
    "labels must be png or coco": lambda: roadeval.pick("no.rrd", 2, "out", labels="jpg"),
    "count must be": lambda: roadeval.audit("no.rrd", -1),
    "labels must be": lambda: roadeval.audit("no.rrd", 2, "out", labels="jpg"),
    "worst must be": lambda: roadeval.clip("no.rrd", "out", worst=-2),
    "worst and frames": lambda: roadeval.clip("no.rrd", "out", worst=2, frames=range(2)),
    "last must be": lambda: roadeval.history("no", last=0),
    "out.doc: the name of a report": lambda: roadeval.write_report("no.rrd", "out.doc"),
    "title must be": lambda: roadeval.write_figures("no.rrd", "out", title="mine"),
}


@pytest.mark.parametrize("sentence", CALLS)
def test_what_the_command_line_refuses_is_refused_before_anything_is_read(
    sentence, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RoadevalError) as refused:
        CALLS[sentence]()
    assert str(refused.value).startswith(sentence)
    assert not [*tmp_path.iterdir()]
