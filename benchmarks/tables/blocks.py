"""Blocks of the texts: tables and sentences made of the numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from benchmarks.tables import idd, idd_filters, overlap, reach_weights, taught
from benchmarks.tables.drives import DRIVES, Drive
from benchmarks.tables.measure import REPLAYS, STRANGERS, TEACHER, command
from roadeval.results.sentences import CLAIMED

Numbers = Mapping[str, Any]
SURE: Final = 0.05
"""The p-value below which a difference stands, as in roadeval's own verdicts."""
MARK: Final = "\\*"
NONE: Final = "-"
"""Text for a number that was not measured."""
ERR_AT_MOST: Final = {"camvid_0016E5_15hz": 0.04, "camvid_0006R0_1hz": 0.025}
"""Greatest ERR that `robust` had to reach on the drives that it was developed on."""
IDD_ERR_AT_MOST: Final = 0.045
ADAPTED: Final = {None: "no", "truth": "its first ten frames", "patch": "the same, without labels"}
NOT_BELOW: Final = 4
"""Greatest number of IDD's drives on which `blind` may be as good."""


@dataclass(frozen=True, slots=True)
class Block:
    """A table or some sentences, and the commands that make their numbers again."""

    body: Callable[[Numbers], str]
    commands: tuple[str, ...]


def _err(numbers: Numbers, drive: str, replay: str, variant: str) -> list[float]:
    """Return ERR with each seed."""
    errs: list[float] = numbers["drives"][drive][replay]["variants"][variant]["ERR"]
    return errs


def _spread_or_none(numbers: Numbers, drive: str, replay: str, variant: str) -> str:
    """Return the spread of ERR; a dash if the replay was not made."""
    made = replay in numbers["drives"][drive]
    return _spread(_err(numbers, drive, replay, variant)) if made else NONE


def _blind(numbers: Numbers, drive: str) -> float:
    err: float = numbers["drives"][drive]["paper"]["blind"]["ERR"]
    return err


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.1f}"


def _points(fraction: float) -> str:
    return f"{round(100 * fraction, 1) + 0.0:+.1f}"  # no "-0.0"


def _spread(values: Sequence[float], show: Callable[[float], str] = _percent) -> str:
    return f"{show(median(values))} ({show(min(values))} to {show(max(values))})"


def _interval(change: Mapping[str, float]) -> str:
    sure = change.get("p_holm")
    mark = f" {MARK}" if sure is not None and sure < SURE else ""
    return f"{_points(change['mean'])} [{_points(change['low'])}, {_points(change['high'])}]{mark}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _bold(texts: Sequence[str]) -> list[str]:
    """Return texts of numbers with the least in bold."""
    least = min((text for text in texts if text != NONE), key=float)
    return [f"**{text}**" if text == least else text for text in texts]


def _and(texts: Sequence[str]) -> str:
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _untouched() -> list[Drive]:
    """Return the real drives that were not used to choose anything."""
    return [d for d in DRIVES.values() if not d.tuned and not d.name.startswith("synthetic")]


# --- README.md ------------------------------------------------------------------------------------


def findings(numbers: Numbers) -> str:
    """Return the findings in five lines."""
    return "\n".join(map(_item, finding_sentences(numbers)))


def finding_sentences(numbers: Numbers) -> Iterator[str]:
    changes = {name: numbers["drives"][name]["paper"]["filter"]["ERR"]["seeds"] for name in DRIVES}
    middles = [round(100 * median(seeds), 1) for seeds in changes.values()]
    up, down = ([middle for middle in middles if sign * middle > 0] for sign in (1, -1))
    yield (
        f"The filter of the paper raises ERR on {len(up)} of {len(DRIVES)} drives, by up to "
        f"{max(up):.1f} points. It lowers ERR on {len(down)}, by up to {-min(down):.1f}."
    )
    below = sum(median(_err(numbers, d, "paper", "filtered")) < _blind(numbers, d) for d in DRIVES)
    yield (
        f"`blind` never looks at the image. The pipeline of the paper beats it on {below} of "
        f"{len(DRIVES)} drives."
    )
    replayed = [name for name in DRIVES if _has_robust(numbers, name)]
    errs = [median(_err(numbers, name, "robust", "robust")) for name in replayed]
    blind = [_blind(numbers, name) for name in replayed]
    yield (
        f"The preset `robust` gets {_range(errs)} % of the pixels wrong on {len(replayed)} drives, "
        f"and `blind` {_range(blind)} %."
    )
    lite = numbers["idd"]
    errs_of = {name: _percent(median(rates["ERR"])) for name, rates in lite["variants"].items()}
    yield (
        f"On {lite['labelled']} drives of IDD Lite: `robust` {errs_of['robust']} %, `blind` "
        f"{_percent(lite['blind']['ERR'])} %, no filter {errs_of['unfiltered']} %, `paper` "
        f"{errs_of['paper']} %."
    )
    claimed = [numbers["drives"][name]["paper"]["claims"]["filter_ERR"] for name in DRIVES]
    right, windows = (sum(claim[key] for claim in claimed) for key in ("held", "windows"))
    yield f"The paper says that its filter lowers ERR: {right} of {windows} windows bear it out."


def _range(errs: Sequence[float]) -> str:
    return f"{_percent(min(errs))} to {_percent(max(errs))}"


# --- docs/explanation -----------------------------------------------------------------------------


def drives(numbers: Numbers) -> str:
    """Return ERR of every preset on every drive, and the effects of the filters."""
    head = ["ERR, %", "`blind`", *FINAL_MASKS]
    rows = [
        [drive.title + (" ¹" if drive.tuned else ""), *_bold(_middles(numbers, drive.name))]
        for drive in DRIVES.values()
    ]
    lite = numbers["idd"]
    by_name = {name: _percent(median(rates["ERR"])) for name, rates in lite["variants"].items()}
    errs = [by_name["unfiltered"], by_name["paper"], NONE, NONE, by_name["robust"]]
    rows.append(
        [f"IDD Lite, {lite['labelled']} drives ¹", *_bold([_percent(lite["blind"]["ERR"]), *errs])]
    )
    return "\n".join((_table(head, rows), "", *_on_filters(numbers)))


FINAL_MASKS: Final = {
    "no filter": ("paper", "unfiltered"),
    "`paper`": ("paper", "filtered"),
    "exposure": ("gated", "unfiltered"),
    "`gated`": ("gated", "filtered"),
    "`robust`": ("robust", "robust"),
}
"""The replay and the variant behind each column; ``exposure`` is `gated` without its filter."""


def _middles(numbers: Numbers, drive: str) -> list[str]:
    """Return ERR of the baseline and of each of `FINAL_MASKS`, the middle of the seeds."""
    replays = numbers["drives"][drive]
    errs = [
        _percent(median(_err(numbers, drive, *column))) if column[0] in replays else NONE
        for column in FINAL_MASKS.values()
    ]
    return [_percent(_blind(numbers, drive)), *errs]


def _on_filters(numbers: Numbers) -> Iterator[str]:
    """Yield the effects of each filter, and of `robust`, on all drives together."""
    for replay in ("paper", "gated"):
        on = REPLAYS[replay].drives
        changes = {name: numbers["drives"][name][replay]["filter"]["ERR"] for name in on}
        middles = {name: round(100 * median(c["seeds"]), 1) for name, c in changes.items()}
        up = {name: middle for name, middle in middles.items() if middle > 0}
        down = {name: middle for name, middle in middles.items() if middle < 0}
        words = [
            f"{does} ERR on {len(those)}, by up to {max(map(abs, those.values())):.1f} points, "
            f"surely on {_sure([changes[name] for name in those])}"
            for does, those in (("raises", up), ("lowers", down))
            if those
        ]
        yield _item(f"Of {len(on)} drives the filter of `{replay}` {'; it '.join(words)}.")
    yield _item(" ".join(_on_robust(numbers)))


def _on_robust(numbers: Numbers) -> Iterator[str]:
    margins = {name: _margins(numbers, name) for name in DRIVES if _has_robust(numbers, name)}
    below = sum(median(seeds) < 0 for seeds in margins.values())
    yield f"`robust` is below `blind` on {below} of the {len(margins)} drives it was replayed on"
    close = [DRIVES[name].title for name, seeds in margins.items() if max(seeds) >= 0]
    yield f"(not with every seed on {_and(close)});" if close else "with every seed;"
    lite = numbers["idd"]
    lost = lite["variants"]["robust"]["not_below_blind"]
    seeds = " to ".join(map(str, sorted({min(lost), max(lost)})))
    yield f"it is not on {seeds} of IDD's {lite['labelled']}."
    rates = {name: numbers["elsewhere"][name] for name in STRANGERS}
    beaten = [
        f"{STRANGERS[name].title} ({_percent(median(rates[name]['ERR']))} against "
        f"{_percent(rates[name]['blind'])} %)"
        for name in rates
        if median(rates[name]["ERR"]) >= rates[name]["blind"]
    ]
    teacher = DRIVES[TEACHER].title
    all_of = f" is below `blind` on all {len(STRANGERS)} others that were scored with it"
    where = f" loses on {_and(beaten)}" if beaten else all_of
    yield f"Trained on {teacher} alone it{where}."


def _item(words: str) -> str:
    return textwrap.fill(words, 100, initial_indent="- ", subsequent_indent="  ")


def _sure(changes: Sequence[Mapping[str, float]]) -> str:
    return str(sum(change["p_holm"] < SURE for change in changes) or "none")


def _has_robust(numbers: Numbers, drive: str) -> bool:
    return "robust" in numbers["drives"][drive]


def _margins(numbers: Numbers, drive: str) -> list[float]:
    """Return ERR of `robust` minus the ERR of `blind`, with each seed."""
    blind = _blind(numbers, drive)
    return [err - blind for err in _err(numbers, drive, "robust", "robust")]


def claims(numbers: Numbers) -> str:
    """Return the paper's claims with the windows of all drives that confirm them."""
    rows = []
    for name, words in CLAIMED.items():
        claimed = [numbers["drives"][drive]["paper"]["claims"][name] for drive in DRIVES]
        held, windows = (sum(claim[key] for claim in claimed) for key in ("held", "windows"))
        every = sum(claim["held"] == claim["windows"] for claim in claimed)
        rows.append([words, f"{held} of {windows}", f"{every} of {len(DRIVES)}"])
    return _table(["claim", "windows that bear it out", "drives where every window does"], rows)


def order(numbers: Numbers) -> str:
    """Return ERR of `paper` with one part as printed, on drives that no choice was made on."""
    others = [*_untouched(), *_synthetic()]
    variants = {"`paper`": "filtered", "`printed_order`": "printed_order", "`hsi`": "hsi"}
    return _table(
        ["ERR of the filtered mask, %", *(drive.title for drive in others)],
        (
            [title, *(_percent(median(_err(numbers, d.name, "paper", variant))) for d in others)]
            for title, variant in variants.items()
        ),
    )


def perfect_shadow(numbers: Numbers) -> str:
    """Return the effect of the paper's compensation on perfectly detected shadow."""
    rates = [numbers["drives"][drive.name]["paper"]["perfect_shadow"] for drive in _synthetic()]
    errs = {key: _and([_percent(drive[key]) for drive in rates]) for key in rates[0]}
    worse = sum(drive["perfect"] > drive["unfiltered"] for drive in rates)
    return textwrap.fill(
        "A better shadow mask would not mend it. On synthetic roads the true shadow is known, and "
        "a replay runs the filter on that, too (`oracles.csv`). The table above has the median of "
        "five seeds; with the first seed and a perfect shadow mask ERR is "
        f"{errs['perfect']} % on the three drives, with the filter's own {errs['filtered']} %, and "
        f"without the filter {errs['unfiltered']} %: on {worse} of {len(rates)} the compensation "
        "harms even where nothing but shadow is compensated. A region gets the mean and the "
        "deviation of its ring, whatever the ring shows.",
        100,
    )


def _synthetic() -> list[Drive]:
    return [drive for drive in DRIVES.values() if drive.name.startswith("synthetic")]


# --- PRESETS.md -----------------------------------------------------------------------------------


def spreads(numbers: Numbers) -> str:
    """Return ERR of every preset on every drive, with the spread of the seeds."""
    columns = {
        "no filter": ("paper", "unfiltered"),
        "`paper`": ("paper", "filtered"),
        "`printed_order`": ("paper", "printed_order"),
        "`hsi`": ("paper", "hsi"),
        **{name: FINAL_MASKS[name] for name in ("exposure", "`gated`", "`robust`")},
    }
    return _table(
        ["ERR, %", "frames", "`blind`", *columns],
        (
            [
                drive.title,
                str(numbers["drives"][drive.name]["paper"]["frames"]),
                _percent(_blind(numbers, drive.name)),
                *(_spread_or_none(numbers, drive.name, *column) for column in columns.values()),
            ]
            for drive in DRIVES.values()
        ),
    )


def filters(numbers: Numbers) -> str:
    """Return the effect of each filter on ERR, with its interval and the spread of the seeds."""
    rows = []
    for drive in DRIVES.values():
        row = [drive.title]
        for replay in ("paper", "gated"):
            if replay not in numbers["drives"][drive.name]:
                row += [NONE, NONE]
                continue
            change = numbers["drives"][drive.name][replay]["filter"]["ERR"]
            row += [_spread(change["seeds"], _points), _interval(change)]
        rows.append(row)
    seeds, first = "seeds", "first seed [interval]"
    head = ["filter's effect, points", f"`paper`: {seeds}", first, f"`gated`: {seeds}", first]
    return _table(head, rows)


def against_blind(numbers: Numbers) -> str:
    """Return every preset's ERR minus the baseline's."""
    rows = []
    for drive in DRIVES.values():
        row, replays = [drive.title], numbers["drives"][drive.name]
        for replay, variant in FINAL_MASKS.values():
            made = replay in replays
            row.append(_interval(replays[replay]["against_blind"][variant]) if made else NONE)
        has_robust = _has_robust(numbers, drive.name)
        rows.append([*row, _spread(_margins(numbers, drive.name), _points) if has_robust else NONE])
    return _table(["ERR minus `blind`, points", *FINAL_MASKS, "`robust`: seeds"], rows)


def placement(numbers: Numbers) -> str:
    """Return ERR of `robust` trained on a drive's first ten frames, and on ten spread along it."""
    on = REPLAYS["spread"].drives
    replays = {name: numbers["drives"][name] for name in on}
    return _table(
        ["`robust`: ERR, %", "frames", "first ten train", "frames", "ten along the drive train"],
        (
            [
                DRIVES[name].title,
                str(replay["robust"]["frames"]),
                _spread(_err(numbers, name, "robust", "robust")),
                str(replay["spread"]["frames"]),
                _spread(_err(numbers, name, "spread", "robust")),
            ]
            for name, replay in replays.items()
        ),
    )


def unlabelled(numbers: Numbers) -> str:
    """Return ERR of `robust` that has learnt from a drive's first ten frames without labels."""
    rows = []
    for name in REPLAYS["patch"].drives:
        replay = numbers["drives"][name]["patch"]
        rows.append(
            [
                DRIVES[name].title,
                str(replay["frames"]),
                _percent(replay["blind"]["ERR"]),
                _spread(replay["variants"]["robust"]["ERR"]),
                _interval(replay["against_blind"]["robust"]),
            ]
        )
    return _table(["ERR, %", "frames", "`blind`, with labels", "`robust`, without", "points"], rows)


def times(numbers: Numbers) -> str:
    """Return the cost of cost stage of the presets."""
    return _table(
        ["640x480, one core", "ms by stage", "together"],
        (
            [
                f"`{preset}`",
                ", ".join(f"`{stage}` {cost:.1f}" for stage, cost in stages),
                f"{sum(cost for _, cost in stages):.1f}",
            ]
            for preset, stages in numbers["stage_times"]
        ),
    )


def claims_by_drive(numbers: Numbers) -> str:
    """Return the windows of each drive that confirm each claim."""
    head = ["claim", *(drive.title for drive in DRIVES.values())]
    return _table(
        head,
        (
            [
                words,
                *(
                    claim_cell(numbers["drives"][drive]["paper"]["claims"][name])
                    for drive in DRIVES
                ),
            ]
            for name, words in CLAIMED.items()
        ),
    )


def claim_cell(claim: Mapping[str, int]) -> str:
    short = f" + {claim['short_held']}/{claim['short']}" if claim["short"] else ""
    return f"{claim['held']}/{claim['windows']}{short}"


def idd_lite(numbers: Numbers) -> str:
    """Return the rates on IDD Lite, with the drives that do not beat `blind`."""
    lite = numbers["idd"]
    blind = lite["blind"]
    rows = [["`blind`", _percent(blind["ERR"]), _percent(blind["dark_missed"]), "", "", ""]]
    titles = {
        "unfiltered": "no filter",
        "gated": "the filter of `gated`, no exposure",
        idd.UNLABELLED: "`robust`, no labels",
    }
    for name in (*idd.VARIANTS, idd.UNLABELLED):
        rates = lite["variants"][name]
        change, lost = rates.get("against_unfiltered"), rates["not_below_blind"]
        rows.append(
            [
                titles.get(name, f"`{name}`"),
                _spread(rates["ERR"]),
                _spread(rates["dark_missed"]),
                f"{median(lost)} ({min(lost)} to {max(lost)}) of {lite['labelled']}",
                _interval(rates["against_blind"]),
                _interval(change) if change else "",
            ]
        )
    return _table(
        [
            *("IDD Lite", "ERR, %", "dark road missed, %", "drives not below `blind`"),
            *("minus `blind`, points", "minus no filter, points"),
        ],
        rows,
    )


def filter_effects(numbers: Numbers) -> str:
    """Return the effects of the gated filter on IDD Lite."""
    chains = numbers["idd_filters"]
    rows = []
    for chain in idd_filters.CHAINS:
        none = chains[chain]["none"]
        rates = [_spread(none[rate]) for rate in ("ERR", "dark_missed")]
        title = chain if chain == "colours" else f"`{chain}`"
        rows.append([title, "no filter", rates[0], "", rates[1], "", ""])
        for odds in map("{:g}".format, idd_filters.ODDS):
            seeds = sorted(chains[chain][odds], key=lambda seed: seed["change"]["mean"])
            rates = [_spread([seed[rate] for seed in seeds]) for rate in ("ERR", "dark_missed")]
            middle = seeds[len(seeds) // 2]
            change, dark, flat = (
                _interval(middle[key]) for key in ("change", "dark_change", "flat_change")
            )
            rows.append(["", odds, rates[0], change, rates[1], dark, flat])
    return _table(
        [
            *("before", "`odds`", "ERR, %", "filter's effect, points", "dark road missed, %"),
            *("filter's effect, points", f"on {chains['flat_frames']} flat frames, ERR, points"),
        ],
        rows,
    )


def shadow_found(numbers: Numbers) -> str:
    """Return precision and recall of the filters' shadow on synthetic roads."""
    rows = []
    for preset, drives in numbers["synthetic_shadow"].items():
        for name, shares in drives.items():
            kinds = ("precision", "recall", "recall_on_road")
            rows.append(
                [f"`{preset}`", DRIVES[name].title, *(f"{shares[kind]:.2f}" for kind in kinds)]
            )
    return _table(
        ["filter", "drive", "precision", "recall, all shadow", "recall, shadow on road"], rows
    )


def features(numbers: Numbers) -> str:
    """Return ERR of `robust` without each group of its features."""
    full = numbers["idd_features"]
    rows = [["none", _percent(full["ERR"]), _percent(full["dark_missed"]), ""]]
    for name, change in full["without"].items():
        err = _percent(full["ERR"] + change["mean"])
        mean, low, high = (f"{100 * change[key]:+.2f}" for key in ("mean", "low", "high"))
        dark = _percent(change["dark_missed"])
        rows.append([f"`{name}`", err, dark, f"{mean} [{low}, {high}]"])
    return _table(["taken away", "ERR, %", "dark road missed, %", "points"], rows)


def aims(numbers: Numbers) -> str:
    """Return the aims of `robust` on the drives of its development, and its results."""
    lite = numbers["idd"]["variants"]["robust"]
    drives = {name: _err(numbers, name, "robust", "robust") for name in ERR_AT_MOST}
    rates = [
        *(
            (DRIVES[name].title, err, ERR_AT_MOST[name], "{:.1f} %", 100)
            for name, err in drives.items()
        ),
        ("IDD Lite", lite["ERR"], IDD_ERR_AT_MOST, "{:.1f} %", 100),
        ("IDD Lite, drives not below `blind`", lite["not_below_blind"], NOT_BELOW, "{:.0f}", 1),
    ]
    rows = (
        [
            title,
            show.format(factor * most),
            show.format(factor * median(rate)),
            "missed" if median(rate) > most else "reached",
        ]
        for title, rate, most, show, factor in rates
    )
    return _table(["`robust`", "at most", "middle seed", ""], rows)


def elsewhere(numbers: Numbers) -> str:
    """Return ERR of `robust` trained on another drive."""
    return _table(
        ["trained on CamVid 0006R0: ERR, %", "`blind`", "`robust`", "minus `blind`, points"],
        (
            [
                STRANGERS[name].title,
                _percent(rates["blind"]),
                _spread(rates["ERR"]),
                _interval(rates["against_blind"]),
            ]
            for name, rates in ((name, numbers["elsewhere"][name]) for name in STRANGERS)
        ),
    )


def taught_by(numbers: Numbers) -> str:
    """Return ERR of `robust` on CamVid's logs, trained on others, with and without own frames."""
    titles = {taught.IDD_LITE: "IDD Lite", **{name: DRIVES[name].title for name in DRIVES}}
    return _table(
        ["trained on", "scored on", "`--adapt`", "`blind`, ERR, %", "`robust`", "points"],
        (
            [
                titles[rates["teacher"]],
                titles[rates["pupil"]],
                ADAPTED[rates["adapt"]],
                _percent(rates["blind"]),
                _spread(rates["ERR"]),
                _interval(rates["against_blind"]),
            ]
            for rates in numbers["taught"]
        ),
    )


def weights(numbers: Numbers) -> str:
    """Return rates of `robust` with each weight of the distance from the patch."""
    drives = {name: drive.title for name, drive in DRIVES.items()}
    teachers = {
        taught.IDD_LITE: "IDD Lite",
        reach_weights.OWN: "its own first ten frames",
        reach_weights.HALF: "half of IDD Lite",
        **drives,
    }
    pupils = {taught.IDD_LITE: "its other half", **drives}
    return _table(
        [
            *("trained on", "scored on", "rate"),
            *(f"weight {weight:g}" for weight in reach_weights.WEIGHTS),
        ],
        (
            [teachers[row["teacher"]], pupils[row["pupil"]], title, *map(_percent, row[rate])]
            for row in numbers["reach_weights"]
            for rate, title in (("ERR", "ERR"), ("dark_missed", "dark road missed"))
            if rate in row
        ),
    )


def tuned_network(numbers: Numbers) -> str:
    """Return ERR of a network unchanged, with a trained threshold, and tuned."""
    titles = {name: drive.title for name, drive in DRIVES.items()}
    titles["idd"] = "IDD Lite, the other half of its drives teaches"
    columns = {
        "`robust`": "robust",
        "network": "network",
        "with the threshold of labelled frames": "threshold",
        "tuned on them": "tuned",
    }
    rows = (
        [
            titles[name],
            _percent(errs["blind"]),
            *(
                _spread(errs[key]) if len({*errs[key]}) > 1 else _percent(errs[key][0])
                for key in columns.values()
            ),
            _interval(errs["change"]),
            _interval(errs["against_network"]),
        ]
        for name, errs in numbers["tuned"]["drives"].items()
    )
    minus = "tuned minus `robust`, points", "minus the network"
    return _table(["ERR, %", "`blind`", *columns, *minus], rows)


def flicker(numbers: Numbers) -> str:
    """Return how much of each mask changes from frame to frame."""
    drive = "camvid_0016E5_15hz"
    replays = numbers["drives"][drive]
    paper, robust = (replays[replay]["variants"] for replay in ("paper", "robust"))
    shares = {
        "in the truth": replays["paper"]["truth_flicker"],
        "with `robust`": robust["robust"]["flicker"],
        "with `paper`": paper["filtered"]["flicker"],
        "with colours and no filter": paper["unfiltered"]["flicker"],
    }
    words = ", ".join(f"{_percent(share)} % {where}" for where, share in shares.items())
    return f"Pixels that change from one frame of {DRIVES[drive].title} to the next: {words}."


def overlap_numbers(numbers: Numbers) -> str:
    """Return every overlap number with its definition and both of its values."""
    compared = numbers["overlap"]
    head = ["number", "stands in", "definition", "is that of", "demo, %", "again, %", "again by"]
    rows, apart = [], 0.0
    for number in overlap.NUMBERS:
        ours, theirs = (compared["values"][number.name][side] for side in ("roadeval", "library"))
        apart = max(apart, abs(ours - theirs))
        values = (f"{100 * value:.4f}" for value in (ours, theirs))
        words = number.stands, number.definition, number.reported_by
        rows.append([number.name, *words, *values, number.library])
    tail = (
        f"Of {compared['evaluated']} frames of the demo drive with `robust`. The two values of a "
        f"number differ by {apart:.0e} at most, and may differ by {overlap.CLOSE:.0e}. The "
        f"definitions of others are those of {overlap.READ}."
    )
    return "\n".join((_table(head, rows), "", textwrap.fill(tail, 110)))


MEASURE: Final = "python -m benchmarks.tables --measure"
PAPER, GATED, ROBUST, SPREAD, PATCH = map(command, ("paper", "gated", "robust", "spread", "patch"))
BLOCKS: Final = {
    "findings": Block(findings, (MEASURE,)),
    "drives": Block(drives, (MEASURE,)),
    "claims": Block(claims, (PAPER,)),
    "order": Block(order, (PAPER,)),
    "perfect_shadow": Block(perfect_shadow, (PAPER,)),
    "spreads": Block(spreads, (PAPER, GATED, ROBUST)),
    "filters": Block(filters, (PAPER, GATED)),
    "placement": Block(placement, (ROBUST, SPREAD)),
    "unlabelled": Block(unlabelled, (PATCH,)),
    "stage_times": Block(times, (f"{MEASURE} stage_times",)),
    "against_blind": Block(against_blind, (PAPER, GATED, ROBUST)),
    "claims_by_drive": Block(claims_by_drive, (PAPER,)),
    "idd": Block(idd_lite, (f"{MEASURE} idd",)),
    "filter_effects": Block(filter_effects, (f"{MEASURE} idd_filters",)),
    "shadow_found": Block(shadow_found, (f"{MEASURE} synthetic_shadow",)),
    "features": Block(features, (f"{MEASURE} idd_features",)),
    "aims": Block(aims, (ROBUST, f"{MEASURE} idd")),
    "elsewhere": Block(elsewhere, (f"{MEASURE} elsewhere",)),
    "taught": Block(taught_by, (f"{MEASURE} taught",)),
    "reach_weights": Block(weights, (f"{MEASURE} reach_weights",)),
    "tuned": Block(tuned_network, (f"{MEASURE} tuned --net NETWORK.onnx --idd idd20k_lite",)),
    "overlap": Block(overlap_numbers, (f"{MEASURE} overlap",)),
    "flicker": Block(flicker, (PAPER, ROBUST)),
}
"""Blocks by their names in the marks."""
