"""The numbers that people read, computed again from the tables by plain arithmetic.

A golden text says that nothing has changed; these say that it is right. Nothing of the project
computes here: tables come by pandas, masks as pictures, and each formula stands here again.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import pandas as pd
import pytest

from roadeval import Recording, write_report
from tests.golden import drive, texts
from tests.golden.commands import Told

MINUS: Final = "\N{MINUS SIGN}"
RUNS: Final = ("paper", "printed")
PDFS: Final = {"paper": "paper.pdf", "printed": "printed/report.pdf"}
OUTS: Final = {"paper": "replay", "printed": "replay_net"}
REPORTS: Final = {"paper": "report", "printed": "report_folder"}
PAIRS: Final = ("svm", "filter", "post")


# --- Plain arithmetic -----------------------------------------------------------------------------


def with_rates(table: pd.DataFrame) -> pd.DataFrame:
    """Rates from counts alone; a rate that divides by zero is undefined."""
    road, other = table.TP + table.FN, table.TN + table.FP
    return table.assign(
        ERR=(table.FP + table.FN) / (road + other),
        ACC=(table.TP + table.TN) / (road + other),
        FPR=table.FP / other.where(other > 0),
        FNR=table.FN / road.where(road > 0),
    )


def totals(table: pd.DataFrame) -> dict[tuple[str, str], pd.Series]:
    """By variant and stage: the frames, the means of their rates, and the sums' own rates."""
    found = {}
    for mask, rows in table.groupby(["variant", "stage"], sort=False):
        sums = rows[["TP", "TN", "FP", "FN"]].sum().to_frame().T
        means = with_rates(rows)[["ERR", "ACC", "FPR", "FNR"]].mean()
        pooled = with_rates(sums).iloc[0]
        tp, fp, fn = sums[["TP", "FP", "FN"]].iloc[0]
        overlap = pd.Series(
            {"IoU": tp / (tp + fp + fn), "F1": 2 * tp / (2 * tp + fp + fn), "P": tp / (tp + fp)}
        )
        overlap["mIoU"] = (overlap["IoU"] + sums["TN"].iloc[0] / (rows["N"].sum() - tp)) / 2
        found[mask] = pd.concat([means, pooled.add_prefix("pooled_"), overlap])
        found[mask]["frames"] = len(rows)
    return found


def percent(fraction: float, digits: int = 2) -> str:
    return f"{100 * fraction:.{digits}f}"


def points(fraction: float) -> str:
    text = f"{100 * fraction:+.2f}"
    return "0.00" if text in ("+0.00", "-0.00") else text.replace("-", MINUS)


def finals(told: Told, run: str) -> pd.DataFrame:
    """The rates of each variant's final mask: frames by variants, with a level a rate."""
    rows = with_rates(told.table("frames", run)).query("stage == 'post'")
    return rows.pivot_table(index="frame", columns="variant", values=["ERR", "ACC", "FPR", "FNR"])


def variants(told: Told, run: str) -> list[str]:
    return told.table("frames", run)["variant"].unique().tolist()


@pytest.fixture(scope="module")
def lines(told):
    """The lines of each report."""
    return {run: "\n".join(texts.pages(told.folder / PDFS[run])).splitlines() for run in RUNS}


# --- The terminal ---------------------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_the_terminal_s_table(run, told):
    shown = [line.replace("**", "").split() for line in told.out(OUTS[run]).splitlines()]
    for (variant, stage), total in totals(told.table("frames", run)).items():
        names = ("ERR", "FPR", "FNR", "ACC", "pooled_ERR", "IoU")
        cells = [percent(total[name]) for name in names]
        row = [stage, str(int(total["frames"])), *cells]
        assert row in shown or [variant, *row] in shown


@pytest.mark.parametrize("run", RUNS)
def test_the_terminal_names_the_error_of_the_focus_and_what_the_filter_changed(run, told):
    means = finals(told, run).mean()
    best = means["ERR"].drop("blind").idxmin()
    focus = {"printed": "net"}.get(run, "filtered")
    out = told.out(OUTS[run])
    words = " ".join(out.split())
    wrong = {name: f"{percent(means['ERR'][name], 1)} %" for name in (focus, best)}
    assert f"{focus}: {wrong[focus]} of the pixels are wrong (" in words
    assert (best == focus) != (f"Best here is {best}: {wrong[best]}." in words)
    points = 100 * (means["ERR"][focus] - means["ERR"]["blind"])
    direction = "worse" if points > 0 else "better"
    assert re.search(rf"{abs(points):.1f} points [^,]*{direction} than blind", words)
    shown = []
    for rate in ("ERR", "FPR", "FNR"):
        change = (finals(told, run)[rate].filtered - finals(told, run)[rate].unfiltered).mean()
        shown.append(re.escape(f"{100 * change:+.2f}".replace("+0.00", "0.00")))
    err, fpr, fnr = shown
    assert re.search(rf"\nfiltered - unfiltered +{err} .* to .* +{fpr} +{fnr}\n", out)


def accounts(read: range, trained: int, gap: int) -> dict[str, int]:
    """What becomes of the frames of a range, from the drive's own list of its oddities."""
    decoded = [number for number in read if number != drive.BROKEN]
    usable = [number for number in decoded if number not in drive.UNLABELLED]
    last = usable[trained - 1]
    left_out = [number for number in decoded if last < number <= last + gap]
    return {
        "in log": drive.FRAMES,
        "read": len(read),
        "decoded": len(decoded),
        # Labels are counted whether their image can be decoded or not.
        "labelled": len(set(read) - set(drive.UNLABELLED)),
        "evaluated": len(usable) - trained - len(left_out),
        "outside the range": read[0],
        "not read (stride or limit)": drive.FRAMES - 1 - read[-1],
        "undecodable": len(read) - len(decoded),
        "trained on": trained,
        "gap after training": len(left_out),
        "unlabelled": len(decoded) - len(usable),
    }


# From 0.25 s on, the frames of 0.3 s and later, whose log times begin when the drive's do.
ACCOUNTS: Final = {"paper": accounts(range(3, 52), 5, 2), "printed": accounts(range(3, 56), 5, 0)}
IN_WORDS: Final = {
    "undecodable": "that cannot be decoded",
    "trained on": "to train on",
    "gap after training": "in the gap after training",
    "unlabelled": "without truth",
}
KEPT: Final = ("in log", "read", "decoded", "labelled", "trained on", "evaluated")


def accounted(run: str) -> Iterator[tuple[str, bool, int]]:
    """Each count that is told: its name, whether those frames were skipped, and the number."""
    for name, count in ACCOUNTS[run].items():
        if name in KEPT:
            yield name, False, count
        if name not in KEPT or name == "trained on":
            yield name, True, count


def flowing(lines: Sequence[str]) -> str:
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize("run", RUNS)
def test_every_frame_is_accounted_for_alike_in_summary_terminal_and_report(run, told, lines):
    account = ACCOUNTS[run]
    skipped = {name: n for name, was_skipped, n in accounted(run) if was_skipped and n}
    kept = {name.replace(" ", "_"): account[name] for name in KEPT}
    assert told.summary(run)["frames"] == kept | {"skipped": skipped}
    assert account["in log"] == account["evaluated"] + sum(skipped.values())

    windows = f", in {-(-account['evaluated'] // 10)} groups of 10"
    why = ", ".join(f"{count} {IN_WORDS.get(name, name)}" for name, count in skipped.items())
    sentence = (
        f"{account['evaluated']} of {account['in log']} frames were evaluated{{}}. Left out: {why}."
    )
    first = told.out(OUTS[run]).partition("\n\n")[0]
    assert " ".join(first.split()) == f"tiny: {sentence.format('')}"
    assert sentence.format(windows) in flowing(lines[run])


def test_what_json_prints_is_the_file_s_text_and_the_recording_s(told):
    assert json.loads(told.out("replay_json")) == told.summary("model")
    recorded, file = Recording(told.folder / "paper.rrd").summary, told.summary()
    # A recording is the same wherever it is written to, so it does not say where that is.
    for summary in (recorded, file):
        summary["run"].pop("output")
    del file["files"], file["origin"]
    assert recorded == file


# --- The report -----------------------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_the_report_s_key_table_and_its_best_in_bold(run, told, lines):
    found, beyond = totals(told.table("frames", run)), told.summary(run)["beyond"]
    columns = ("ERR", "FPR", "FNR", "ACC", "pooled_ERR", "IoU", "mIoU", "F1", "P")
    edges = ("boundary_F", "boundary_IoU")
    table = {
        variant: [found[variant, "post"][c] for c in columns] + [beyond[variant][e] for e in edges]
        for variant in variants(told, run)
    }
    for variant, row in table.items():
        frames = int(found[variant, "post"]["frames"])
        assert f"Percent: means over {frames} frames" in flowing(lines[run])
        assert " ".join([variant, *map(percent, row)]) in lines[run]
    lower_is_better = [True, True, True, False, True] + 6 * [False]
    best = [
        (min if lower else max)(table, key=lambda variant: table[variant][place])
        for place, lower in enumerate(lower_is_better)
    ]
    # The table is set row by row.
    wanted = [
        percent(value)
        for variant, row in table.items()
        for value, winner in zip(row, best, strict=True)
        if winner == variant
    ]
    assert "".join(texts.bold(told.folder / PDFS[run], 1)) == "".join(wanted)


@pytest.mark.parametrize("run", RUNS)
def test_the_report_s_differences(run, told, lines):
    table, text = finals(told, run), " ".join(lines[run])
    names = variants(told, run)[:-1]
    pairs = [(name, "unfiltered") for name in names if name != "unfiltered"]
    pairs += [(name, "blind") for name in names]
    for mine, theirs in pairs:
        change = {rate: table[rate][mine] - table[rate][theirs] for rate in ("ERR", "FPR", "FNR")}
        both = [percent(table["ERR"][name].mean()) for name in (theirs, mine)]
        begin = " ".join([mine, MINUS, theirs, *both, points(change["ERR"].mean())])
        (row,) = (line for line in lines[run] if line.startswith(begin))
        *_, fpr, fnr, better, worse, _ = row.split()
        assert [fpr, fnr] == [points(change[rate].mean()) for rate in ("FPR", "FNR")]
        frames = [(change["ERR"] < 0).sum(), (change["ERR"] > 0).sum()]
        assert [int(better), int(worse)] == frames
    worse_than_blind = [
        name for name in names if table["ERR"][name].mean() > table["ERR"].blind.mean()
    ]
    told_so = f"worse than blind (ERR {percent(table['ERR'].blind.mean())}"
    assert (told_so in text) == bool(worse_than_blind)
    rows = told.table("frames", run).query("stage == 'post'")
    wrong = (rows.FP + rows.FN).groupby(rows.variant).sum()
    net = wrong.filtered - wrong.unfiltered
    word = "more" if net > 0 else "fewer"
    assert f"without it: {abs(net):,} {word} wrong pixels in all." in flowing(lines[run])


REGIONS: Final = {
    "shadow": "inside detected shadow",
    "shadow_edge": "at the edge of detected shadow",
    "lit": "in light",
    "true_shadow": "inside true shadow",
    "boundary": "near the road's edge",
    "interior": "away from the road's edge",
    "band_0": "image rows 0\N{EN DASH}9, the top",
    "band_1": "image rows 10\N{EN DASH}19",
    "band_2": "image rows 20\N{EN DASH}28",
    "band_3": "image rows 29\N{EN DASH}38",
    "band_4": "image rows 39\N{EN DASH}47, the bottom",
}


@pytest.mark.parametrize("run", RUNS)
def test_the_report_s_chart_of_regions(run, told):
    rows = told.table("regions", run).query("stage == 'post'")
    sums = rows.groupby(["variant", "region"])[["TP", "TN", "FP", "FN"]].sum()
    wrong, pixels = sums.FP + sums.FN, sums.sum(axis=1)
    names = variants(told, run)
    assert set(REGIONS) == set(rows["region"])
    halves = (["boundary", "interior"],)
    (drawn,) = (
        each for each in told.texts[REPORTS[run]]["figures"] if "ERR within the region" in each
    )
    within, errors = drawn.split("'Share of the wrong pixels'")
    (order,) = set(re.findall(r"names (.*)", drawn))
    assert sorted(order.split(" | ")) == sorted(REGIONS.values())
    places = {title: place for place, title in enumerate(order.split(" | "))}
    shares = [float(each) for each in re.findall(r"share (.*)", errors)[0].split()]
    for region, title in REGIONS.items():
        place, whole = places[title], pixels[names[0]].loc[halves].sum()
        assert shares[place] == close(pixels[names[0], region] / whole)
        for name in names:
            assert mark(within, name, place) == close(wrong[name, region] / pixels[name, region])
            assert mark(errors, name, place) == close(
                wrong[name, region] / wrong[name].loc[halves].sum()
            )


def close(fraction: float) -> float:
    """What four digits of a percentage are close to."""
    return pytest.approx(100 * fraction, rel=1e-3, abs=1e-9)


def mark(chart: str, name: str, place: int) -> float:
    """A variant's number at a place of a chart that was drawn."""
    (points_,) = re.findall(rf"'{name}', .*?: (\(.*\))", chart)
    return dict(map(float, each.split()) for each in re.findall(r"\((.*?)\)", points_))[place]


def parts(told: Told) -> pd.DataFrame:
    """How each frame's ERR of the filtered mask came about."""
    rows = with_rates(told.table("frames"))
    errors = rows.pivot_table(index="frame", columns=["variant", "stage"], values="ERR")
    return pd.DataFrame(
        {
            "svm": errors["unfiltered", "svm"],
            "filter": errors["filtered", "svm"] - errors["unfiltered", "svm"],
            "post": errors["filtered", "post"] - errors["filtered", "svm"],
            "ERR": errors["filtered", "post"],
        }
    )


@pytest.mark.parametrize("run", RUNS)
def test_the_page_s_milliseconds_are_the_summary_s_seconds(run, told):
    made = write_report(told.folder / f"{run}.rrd", told.folder / f"{run}.html").read_text("utf-8")
    rows = [
        " ".join(re.sub("<[^>]*>", " ", row).split())
        for row in re.findall("<tr.*?</tr>", made, re.S)
    ]
    for variant, stages in told.summary(run)["seconds"].items():
        for stage, seconds in stages.items():
            assert f"{variant} {stage} {1000 * seconds:.2f}" in rows


def test_figure_2_shows_the_frames_that_the_report_shows(told, lines):
    figure = next(each for each in told.texts["replay"]["figures"] if "Road masks" in each)
    drawn = re.findall(r"text 'frame (\d+)'", figure)
    assert len(drawn) == 4
    assert [int(each) for each in drawn] == told.summary()["examples"]
    text = "\n".join(lines["paper"])
    begin, end = (text.index(words) for words in ("the paper's figure 2", "the paper's figure 3a"))
    figures = text[begin:end]
    assert re.findall(r"frame (\d+)", figures) == drawn


# --- The worst frames -----------------------------------------------------------------------------


SCENE: Final = 12
"""Frames from one scene to the next: a quarter of those that were evaluated."""


def apart(ranked: pd.Series, count: int, least: int = 2, besides: Sequence[int] = ()) -> list[int]:
    """The first frames of a ranking, of those closer than ``least`` frames only the first."""
    taken: list[int] = []
    for frame in ranked.index:
        if len(taken) < count and all(abs(frame - other) >= least for other in [*besides, *taken]):
            taken.append(frame)
    return taken


def test_the_list_of_the_worst_frames(told):
    table = finals(told, "paper")
    worst = apart(table["ERR"].filtered.sort_values(ascending=False), 10, SCENE)
    text = " ".join(told.out("inspect").split())
    for rank, frame in enumerate(worst, 1):
        own = table.loc[frame]
        rates = [own[rate].filtered for rate in ("ERR", "FPR", "FNR")]
        cells = ["-" if np.isnan(rate) else percent(rate) for rate in rates]
        assert f"{rank} {frame} {' '.join(cells)} " in text
        if rates[2] >= 0.0005:
            assert f" Misses {100 * rates[2]:.1f} % of the road and takes " in text


# --- The recording --------------------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_the_viewer_s_curves_are_the_table_s_numbers(run, told):
    curves = texts.by_frame(told.folder / f"{run}.rrd", "Scalars:scalars")
    table = told.table("frames", run)
    for (variant, stage), rows in table.groupby(["variant", "stage"]):
        own = rows.set_index("frame")
        counts = dict(curves[f"/counts/{variant}/{stage}"])
        assert counts == {
            n: row.tolist() for n, row in own[["TP", "TN", "FP", "FN", "N"]].iterrows()
        }
        for rate in ("ACC", "ERR", "TPR", "FNR", "TNR", "FPR"):
            shown = {n: value for n, (value,) in curves[f"/metrics/{variant}/{stage}/{rate}"]}
            assert shown == pytest.approx(own[rate].dropna().to_dict())


# --- The comparison -------------------------------------------------------------------------------


def changes_shown(out: str) -> dict[tuple[str, str, str], list[str]]:
    """Base, new and change on the terminal by variant, stage and rate; a name stands once."""
    found, variant, stage = {}, "", ""
    for line in out.splitlines():
        if match := re.match(r"(\w*) +(\w*) +(ERR|FPR|FNR) +(\S+) +(\S+) +(\S+) ", line):
            variant, stage = match[1] or variant, match[2] or stage
            found[variant, stage, match[3]] = [match[4], match[5], match[6]]
    return found


def test_the_comparison_s_table_is_of_the_frames_that_both_evaluated(told):
    base, new = (with_rates(told.table("frames", run)) for run in RUNS)
    both = base.merge(new, on=["stamp_ns", "variant", "stage"], suffixes=("_base", "_new"))
    shown = changes_shown(told.out("compare"))
    for (variant, stage), rows in both.groupby(["variant", "stage"]):
        for rate in ("ERR", "FPR", "FNR") if stage == "post" else ("ERR",):
            if variant == "blind":  # as it was on every frame, so it has no row
                assert rows[f"{rate}_base"].equals(rows[f"{rate}_new"])
                continue
            before, after = rows[f"{rate}_base"].mean(), rows[f"{rate}_new"].mean()
            change = (rows[f"{rate}_new"] - rows[f"{rate}_base"]).mean()
            cells = [percent(before), percent(after), points(change).replace(MINUS, "-")]
            assert shown.pop((variant, stage, rate)) == cells
    assert not shown
    left_out = new["frame"].nunique() - both["frame_new"].nunique()
    assert f"warning: {left_out} frames that printed evaluated" in told.texts["compare"]["err"]


def test_the_conditions_are_judged_by_the_same_numbers(told):
    base, new = (with_rates(told.table("frames", run)) for run in RUNS)
    own = "variant == 'filtered' and stage == 'post'"
    both = base.query(own).merge(new.query(own), on="stamp_ns", suffixes=("_base", "_new"))
    before, after = both.ERR_base.mean(), both.ERR_new.mean()
    assert (
        "error: limit exceeded: post.filtered.ERR of printed changed by "
        f"{100 * (after - before):+.2f} points, from {percent(before)} % to {percent(after)} % "
        "(limit: post.filtered.ERR>+0.5pp)\n"
    ) in told.texts["compare"]["err"]
    level = new.query("variant == 'unfiltered' and stage == 'svm'").FNR.mean()
    assert f"FNR of printed is {percent(level)} % (limit: " in told.out("compare")
    assert told.texts["compare"]["code"] == 4


def changed_most(path):
    """The lines of a comparison's last table."""
    return path.read_text().partition("Frames that changed most")[2].splitlines()


@pytest.mark.parametrize("name", ["compared", "variants"])
def test_the_comparison_names_the_frames_that_changed_most(name, told):
    paper, printed = (finals(told, run)["ERR"] for run in RUNS)
    before, after = {
        "compared": (paper.filtered, printed.filtered),
        "variants": (printed.unfiltered, printed.filtered),
    }[name]
    change = (after - before).dropna().sort_values()
    wanted = apart(change[change > 0][::-1], 5) + apart(change[change < 0], 5)
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in changed_most(told.folder / f"{name}.md")
        if " UTC " in line
    ]
    rows = [row for row in rows if "filtered" in row]
    shown = [[*row[-5:-4], *row[-3:]] for row in rows]
    assert shown == [
        [str(n), percent(before[n]), percent(after[n]), points(change[n])] for n in wanted
    ]
