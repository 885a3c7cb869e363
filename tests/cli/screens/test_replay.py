"""What a replay came to, on a screen of 80 columns."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from roadeval.cli.screens import replay as outcome
from roadeval.evaluation.stats import Difference
from roadeval.jobs.run.replay import Outcome
from roadeval.results.facts import DriveFacts, Facts, FrameAccount

RATES = ("ACC", "ERR", "TPR", "FNR", "TNR", "FPR")


def total(err, pooled=None, frames=91):
    """The sums of a stage, of which the tests look at ERR alone."""
    rates = dict.fromkeys(RATES, 0.5) | {"ERR": err}
    pooled_rates = {f"pooled_{rate}": 0.5 for rate in RATES} | {"pooled_ERR": pooled or err}
    counts = {"TP": 6, "TN": 10, "FP": 3, "FN": 1}
    return {"frames": frames} | counts | rates | pooled_rates


TOTALS = {
    "filtered": {"similarity": total(0.2), "post": total(0.0912, pooled=0.0934)},
    "unfiltered": {"similarity": total(0.15), "post": total(0.0847)},
    "blind": {"post": total(0.0721)},
}


def difference(mean, low=None, high=None, p_holm=None):
    corrected = {"p_holm": p_holm, "comparisons": 2 if p_holm else None}
    return Difference(mean, low, high, None, 0.95, "frames", 91, **corrected)


def by_rate(err):
    return {"ERR": err, "FPR": difference(0.001), "FNR": difference(-0.002)}


def summary(**changed):
    parts = {
        "drive": DriveFacts("drive"),
        "frames": FrameAccount(101, 101, evaluated=91, skipped={"trained on": 10}),
        "windows": 10,
        "totals": TOTALS,
        "difference": {"post": by_rate(difference(0.0065, 0.001, 0.012, 0.02))},
        "verdict": "On this drive the filter harms.",
    }
    return Facts(**parts | changed)


def screen(results, folder=Path("reports/drive"), recording=None):
    out = Console(file=io.StringIO(), width=80)
    outcome.show(Outcome(recording, folder, results, (), (), (folder / "frames.csv",)), out)
    return out.file.getvalue()


@pytest.mark.parametrize(
    ("labelled", "why"), [(0, "has road truth"), (10, "was trained on or left out")]
)
def test_where_nothing_is_scored_it_says_why(labelled, why):
    frames = FrameAccount(39, 39, labelled=labelled, skipped={"unlabelled": 39})
    shown = screen(summary(frames=frames, totals={}, difference={}, windows=0))
    assert shown.startswith("drive: 0 of 39 frames were evaluated. Left out: 39 without truth.\n")
    assert "Nothing to score: " in shown
    assert why in shown
    assert "%" not in shown


@pytest.mark.parametrize(("display", "first"), [(":0", "rerun"), ("", "inspect")])
def test_what_to_type_next_can_be_typed_here(display, first, monkeypatch, tmp_path):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    recording = tmp_path / "out.rrd"
    recording.write_bytes(b"")
    shown = screen(summary(), recording=recording)
    programs = [line.split()[1:] for line in shown.splitlines() if line.startswith("next ")]
    assert all(Path(program).exists() for program, *_ in programs)
    assert [first in " ".join(words[:2]) for words in programs] == [True, first == "inspect", False]


# --- What other seeds come to, on a screen of 80 columns ------------------------------------------
