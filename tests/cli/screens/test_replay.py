"""What a replay came to, on a screen of 80 columns."""

import io
import math
import re
from pathlib import Path

import pytest
from rich.console import Console

from roadeval.cli.screens import replay as outcome
from roadeval.evaluation.stats import Difference
from roadeval.jobs.run.replay import Outcome
from roadeval.results.facts import DriveFacts, Facts, FrameAccount, LogFacts

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


def lines(results):
    """The lines of the screen, with single spaces."""
    return [" ".join(line.split()) for line in screen(results).splitlines()]


def test_an_undefined_rate_is_a_dash():
    totals = {"filtered": {"post": total(math.nan)}, "unfiltered": {"post": total(0.3)}}
    assert "filtered post 91 - 50.00 50.00 50.00 - 60.00" in lines(summary(totals=totals))


def test_a_difference_that_does_not_stand_bears_no_mark():
    unsure = {"filtered": by_rate(difference(0.0065, -0.001, 0.012, 0.08))}
    shown = lines(summary(against_blind=unsure))
    assert "filtered - blind +0.65 -0.10 to +1.20 +0.10 -0.20" in shown
    assert "significant after Holm's correction for the 2 differences of ERR" in " ".join(shown)


def test_the_mark_is_explained_only_where_there_is_one():
    unsure = {"filtered": by_rate(difference(0.0065, -0.001, 0.012, 0.08))}
    assert "Holm" not in screen(summary(difference={}, against_blind=unsure))


def test_a_difference_without_an_interval_has_none():
    shown = lines(summary(difference={"post": by_rate(difference(-0.002))}))
    assert "filtered - unfiltered -0.20 none given +0.10 -0.20" in shown


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


def test_a_long_path_is_never_broken():
    folder = Path("/results", "a-long-name" * 10)
    shown = screen(summary(), folder)
    assert f"results    {folder}/ (" in shown
    assert re.search(rf"\nnext       \S*roadeval report {folder}\n", shown)


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


def test_a_log_without_labels_is_told_how_to_get_them(tmp_path):
    frames = FrameAccount(39, 39, labelled=0, skipped={"unlabelled": 39})
    log = LogFacts("street.mcap", "0")
    shown = screen(summary(frames=frames, totals={}, difference={}, windows=0, log=log), tmp_path)
    assert re.search(r"\nnext       \S*roadeval replay street.mcap --truth LABELS\n", shown)


@pytest.mark.parametrize(
    ("length", "words"), [(0, "0.1 kB"), (2_340, "2.3 kB"), (34_200_000, "34.2 MB")]
)
def test_sizes_are_for_people(length, words, tmp_path):
    file = tmp_path / "out.rrd"
    file.touch()
    with file.open("r+b") as opened:
        opened.truncate(length)
    assert outcome.size(file) == words


# --- What other seeds come to, on a screen of 80 columns ------------------------------------------


def rates(*errors):
    """A final mask's rates with each seed; all but ERR are undefined."""
    names = ("ACC", "ERR", "FNR", "FPR", "pooled_ERR")
    return {"post": dict.fromkeys(names, [None] * len(errors)) | {"ERR": [*errors]}}


SEEDS = {
    "seeds": [0, 1, 2],
    "totals": {"filtered": rates(0.0912, 0.1, 0.12), "unfiltered": rates(0.0847, 0.08, 0.083)},
    "difference": {"post": {"ERR": [0.0065, 0.02, 0.037]}},
}
SURE = {"post": by_rate(difference(0.0065, 0.001, 0.012, 0.02))}


def test_every_variant_s_final_mask_has_a_row_with_the_middle_and_both_ends():
    shown = screen(summary(seeds=SEEDS))
    assert "Percent, with seeds 0 to 2 of the training: the middle" in shown
    (filtered,) = (line for line in lines(summary(seeds=SEEDS)) if "10.00 (9.12" in line)
    assert filtered.split()[:5] == ["filtered", "10.00", "(9.12", "to", "12.00)"]
    assert "unfiltered 8.30 (8.00 to 8.47)" in " ".join(shown.split())
    assert "filtered - unfiltered, pp +2.00 (+0.65 to +3.70)" in " ".join(shown.split())
    assert "All else is of seed 0." in " ".join(shown.split())
    assert shown.isascii() or not (set(shown) - set("─")) & set("–−")  # noqa: RUF001
    assert max(map(len, shown.partition("\nnext ")[0].splitlines())) <= 80


def test_without_further_seeds_not_a_word_is_said_of_them():
    assert "seed" not in screen(summary(difference=SURE))
