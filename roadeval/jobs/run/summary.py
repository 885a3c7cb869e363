"""The facts of a run: its findings, its frames and its settings."""

from __future__ import annotations

import platform
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.config.variants import AS_IT_IS
from roadeval.data import BASELINE, CERTAIN, FINAL_STAGE, TUNED, Role
from roadeval.data.words import listing
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.evaluation.score.degradation import degradations
from roadeval.evaluation.score.fit import LAST_LAG, TRUTH, Finding, FitCheck, Misfit
from roadeval.evaluation.score.scoreboard import DriveSums, drive_effects
from roadeval.evaluation.stats.sampling import Estimate, estimate
from roadeval.jobs.run.prepared import Run, computing
from roadeval.logs.errors import FrameError
from roadeval.logs.frames import Selection
from roadeval.logs.log import Log
from roadeval.logs.settings import LogConfig
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.truth.named_labels import NamedLabels
from roadeval.logs.truth.picks import PICK, Picks
from roadeval.results.facts import (
    DriveFacts,
    EstimateFacts,
    Facts,
    FrameAccount,
    LogFacts,
    Totals,
    TrainingFacts,
)
from roadeval.results.sentences import misfit
from roadeval.results.tables import TableFacts
from roadeval.results.verdict import describe_doubts, verdict_on
from roadeval.runtime import discovery
from roadeval.runtime.sentence import Sentence, Setting
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

FEW: Final = 12
"""Number of frames of a log that are examined, with their neighbours, if nothing is replayed."""
RANKS_AT_ONCE: Final = ("entropy", "disagreement")
"""Signs of doubt that follow from one frame, without the frame before."""
OF_ONE_CAMERA: Final = ("beyond", "curves", "thresholds", "slices", "oracles", "why", "seconds")
"""Names of facts that only a single camera has, not a rig."""


def make_facts(
    run: Run, sums: DriveSums, examples: list[int], table_facts: dict[str, TableFacts]
) -> Facts:
    """Return the facts of a run at its end, with the frames of figure 2.

    ``table_facts`` are rows and checksums of the tables.
    """
    settings, selection, doubts = run.config.training, run.selection, run.board.unlabelled
    is_given = settings.model is not None and not settings.adapt
    facts = Facts(
        **sums.parts,
        effects=[*sums.effects],
        verdict="",
        misfits=[misfit_sentence(f, selection, run.config) for f in run.fit.findings()],
        unlabelled=describe_doubts(doubts.rows(), doubts.differing()),
        estimate=_estimate_rates(run, sums.frames),
        thresholds=dict(_best_thresholds(run)),
        drive=DriveFacts(
            run.log.name,
            run.key.camera,
            *(selection.size or (0, 0)),
            rate_hz=selection.image.rate_hz,
            **sums.times,
            topics=[*selection.reasons, *run.config.ignored_settings()],
            calibration=run.calibration,
            ground=selection.ground_as_read,
        ),
        frames=_account_for_frames(run),
        examples=examples,
        training=TrainingFacts(
            run.model.source,
            len(run.model.digests),
            run.model.pixels,
            settings.model,
            None if is_given else "picked" if run.schedule.picks else settings.placement,
            settings.adapt,
        ),
        warnings=list(warnings(run, sums.parts["totals"])),
        losses=[*run.log.losses, *run.frames.accounting.losses, *run.failures.sentences()],
        run=run.config.as_dict(),
        settings={variant.name: variant.pipeline.as_dict() for variant in run.variants},
        methods=run.methods,
        versions=versions(),
        log=LogFacts(run.log.source, run.log.digest),
        masks=_mask_facts(run),
        tables=table_facts,
    )
    return replace(facts, verdict=verdict_on(facts))


def _estimate_rates(run: Run, frames: pd.DataFrame) -> EstimateFacts | None:
    """Estimate the final masks' rates on the whole drive, from frames that were drawn at random."""
    picks = run.schedule.picks
    if picks is None:
        return None
    every, confidence = picks.every_score(), run.config.evaluation.confidence
    rates: dict[str, dict[str, Estimate]] = {}
    problem = _why_not_random(run, picks)
    finals = tables.finals(frames.iloc[:0] if problem else frames)
    for (variant,), rows in tables.group_rows(finals, ["variant"]):
        for rate in (rate for rate in METRICS if rate in SHORT):
            defined = rows[rows[rate].notna()]
            if len(defined):
                scores = every[[picks.places[float(stamp)] for stamp in defined["stamp_ns"]]]
                values = defined[rate].to_numpy()
                rates.setdefault(variant, {})[rate] = estimate(values, scores, every, confidence)
    apart: dict[str, dict[str, float | None]] = {
        str(frame): dict(rates_apart) for frame, rates_apart in run.board.apart.items()
    }
    labels = frames["frame"].nunique()
    chance = picks.drawn / len(every)
    return EstimateFacts(len(every), picks.drawn, labels, chance, rates, apart, problem)


def _why_not_random(run: Run, picks: Picks) -> str:
    """Return why the labelled frames are not a random part of the drive, or an empty text."""
    if picks.log != run.log.digest:
        return "the log is not as it was when its frames were picked: pick again, into a new folder"
    account, labelled = run.frames.accounting, run.config.frames.labelled
    if account.in_range < account.in_log or (account.read < account.in_range and not labelled):
        return "only a part of the drive was read"
    return ""


def misfits_of_truth(log: Log) -> Iterator[str]:
    """Yield sentences on truth that does not fit the images, by a few frames and neighbours."""
    selection = log.select()
    numbers = selection.among_truth(log.frames(selection).numbers)
    places = np.linspace(0, len(numbers) - 1, FEW, dtype=int).tolist()
    every = log.config.frames.every
    lags = range(-LAST_LAG * every, LAST_LAG * every + 1, every)
    near = {numbers[place] + lag for place in places for lag in lags}
    fit = FitCheck(numbers, every, FEW)
    for logged in log.frames(selection, near):
        with suppress(FrameError):
            fit.add(logged.decode())
    for finding in fit.findings():
        yield misfit_sentence(finding, selection, log.config)


def misfit_sentence(finding: Finding, selection: Selection, config: LogConfig) -> str:
    """Return a sentence on truth or masks that do not fit the images, and what to do about it."""
    rate, is_truth = selection.image.rate_hz, finding.subject == TRUTH
    period_ms = 1000 / rate if rate else None
    source = selection.truth if is_truth else selection.masks[finding.subject]
    pictures = None if source is None else source.pictures
    what = "labels" if is_truth else "masks"
    remedy = f"No number is corrected for it: mend the {what} where they are made."
    if finding.misfit is Misfit.LAG and isinstance(pictures, NamedLabels):
        first = pictures.first + finding.frames
        setting = "truth" if is_truth else f"masks.{finding.subject}"
        if pictures.by == "number" and first >= 0:
            remedy = Sentence("Set {} to {}.", Setting(f"{setting}.first"), first)
    by_time = source is not None and isinstance(source.pairing.images, TopicReader)
    if finding.misfit is Misfit.LAG and is_truth and period_ms and by_time:
        offset = config.topics.sync_offset_ms - finding.frames * period_ms
        remedy = Sentence("Set {topics.sync_offset_ms} to {}.", f"{offset:.0f}")
    pixels = {name: round(getattr(finding, name) / selection.scale) for name in ("right", "down")}
    finding = replace(finding, **pixels)
    return misfit(finding, period_ms, remedy)


def _best_thresholds(run: Run) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the thresholds that are best on the training frames, for methods that learn nothing."""
    best = run.board.thresholds()
    masks = [(name, mask.threshold) for name, mask in run.config.masks.items()]
    lines_of = {name: at for name, at in masks if at is not None and name not in run.chains}
    # Five digits tell codes apart. Road is above the code of a stage, but at or above the threshold
    # of masks.
    lines = dict.fromkeys(lines_of, ("threshold = {:.5f}", 0.5 / CERTAIN))
    for variant in run.variants:
        stages = variant.pipeline.settings
        post = stages[FINAL_STAGE]
        is_final = all(getattr(post, key) == value for key, value in AS_IT_IS.items())
        if is_final and not variant.pipeline.learning_stages():
            net = stages.get("net")
            lines_of[variant.name] = 0.5
            if net is not None and net.threshold is not None:
                lines_of[variant.name] = net.threshold
                decided = 'decide = "argmax"\n' * (net.decide == "argmax")
                lines[variant.name] = (f"{decided}threshold = {{:.5f}}", 0)
    for name, threshold in lines_of.items():
        line, more = lines.get(name, ("", 0))
        for at in best.get(name, {}).values():
            yield name, {"own": threshold, **at, "lines": line.format(at["threshold"] + more)}


def join_cameras(
    frames: pd.DataFrame,
    disturbed: pd.DataFrame,
    cameras: Mapping[str, Facts],
    table_facts: dict[str, TableFacts],
) -> Facts:
    """Return the facts of a rig, in which every camera counts the same."""
    first, *_ = cameras.values()
    by_camera = tables.totals(frames, ["camera", *tables.MASK])
    empty: Mapping[str, Any] = {name: {} for name in OF_ONE_CAMERA}
    misfits: list[str] = [
        Sentence("{}: {}", name, text) for name, facts in cameras.items() for text in facts.misfits
    ]
    accounts = [asdict(facts.frames) for facts in cameras.values()]
    skipped = Counter[str]()
    for account in accounts:
        skipped.update(account.pop("skipped"))
    counted = {name: sum(account[name] or 0 for account in accounts) for name in accounts[0]}
    facts = replace(
        first,
        effects=drive_effects(frames, first.evaluation),
        misfits=misfits,
        drive=DriveFacts(first.drive.name, rate_hz=first.drive.rate_hz),
        frames=FrameAccount(**counted, skipped=dict(skipped)),
        totals=tables.as_trees(tables.over_cameras(by_camera)),
        windows=sum(facts.windows for facts in cameras.values()),
        claims=_add_counts(facts.claims for facts in cameras.values()),
        health=_add_counts(facts.health for facts in cameras.values()),
        warnings=[*_name_cameras({name: facts.warnings for name, facts in cameras.items()})],
        losses=[*_name_cameras({name: facts.losses for name, facts in cameras.items()})],
        disturbances=degradations(disturbed, frames, first.evaluation),
        training=TrainingFacts(first.training.source, model=first.training.model),
        tables=table_facts,
        cameras={**cameras},
        examples=[],
        **empty,
    )
    return replace(facts, verdict=verdict_on(facts))


def _add_counts(parts: Iterable[Mapping[str, Mapping[str, int]]]) -> dict[str, dict[str, int]]:
    """Add up the counts of cameras, which are nested by two names."""
    sums: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for part in parts:
        for name, counts in part.items():
            sums[name].update(counts)
    return {name: dict(counts) for name, counts in sums.items()}


def _name_cameras(sentences: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield the cameras' sentences, with the camera's name unless all cameras say the same."""
    first, *others = sentences.values()
    common = [sentence for sentence in first if all(sentence in other for other in others)]
    yield from common
    for camera, of_camera in sentences.items():
        yield from (Sentence("{}: {}", camera, text) for text in of_camera if text not in common)


def versions() -> dict[str, str]:
    """Return the versions of roadeval, of Python, and of the libraries that compute or write."""
    writing = discovery.versions_of(("rerun-sdk", "pandas", "matplotlib"))
    return {"roadeval": VERSION, "python": platform.python_version(), **computing(), **writing}


def warnings(run: Run, totals: Totals) -> Iterator[str]:
    """Yield warnings that a user should read before using the results."""
    yield from _truth_warnings(run, totals)
    yield from (str(damage) for damage in run.log.damage if not damage.lossy)
    yield from (Sentence("{}: {}", run.selection.image.name, n) for n in run.selection.notes)
    yield from run.frames.accounting.notes
    selection, prior, scale = run.selection, run.model.prior, run.config.frames.scale
    if scale != 1 and selection.image.size:
        width, height = selection.image.size
        yield (
            f"the frames, {width}x{height} in the log, are reduced to "
            f"{scale:g} of it: the numbers are not those of full frames"
        )
    if run.config.training.model is not None and prior is not None and selection.size:
        width, height = selection.size
        if prior.shape != (height, width):
            yield (
                f"the model learnt from frames of {prior.shape[1]}x{prior.shape[0]}, and these "
                f"are {width}x{height}: texture and sizes in pixels mean something else there"
            )
    if selection.ground and (lens := selection.calibration) and selection.calibration_why:
        yield Sentence("metres rest on {}: {}", lens.topic, selection.calibration_why)
    yield from _method_warnings(run)
    yield from _mask_warnings(run, totals)
    roles, settings = Counter(run.board.roles()), run.config.training
    is_given = settings.model is not None and not settings.adapt
    if is_given and roles[Role.TRAINING] and roles[Role.EVALUATED]:
        yield (
            f"{roles[Role.TRAINING]} of the model's {len(run.model.digests)} training frames lie "
            "in this drive; their neighbours are evaluated and look alike, which flatters the "
            "result: use a model of other drives"
        )
    yield from _pick_warnings(run)
    for variant, stages in totals.items():
        *_, total = stages.values()
        for share, where in ((0, "nowhere"), (1, "everywhere")):
            if variant != BASELINE and total["pooled_TPR"] == total["pooled_FPR"] == share:
                yield f"{variant}: its final mask is road {where}, on every frame"
    yield from run.model.warnings


def _truth_warnings(run: Run, totals: Totals) -> Iterator[str]:
    """Yield warnings for a log with little truth, or none."""
    finals = [[*stages.values()][-1] for stages in totals.values()]
    for where, counts in (("nowhere", ("TP", "FN")), ("everywhere", ("TN", "FP"))):
        is_seen = any(total[count] for total in finals for count in counts)
        if not is_seen and any(total["N"] for total in finals):
            yield f"the truth is road {where}, on all frames that are scored: is it read right?"
    if missing := run.selection.no_truth:
        no_truth = "there is no road truth to score against, only masks to look at: {}"
        yield Sentence(no_truth, missing)
        rule, doubts = run.config.output.record, run.board.unlabelled
        unlabelled = describe_doubts(doubts.rows(), doubts.differing())
        if rule.startswith("worst:") and unlabelled:
            pictures = (
                "kept the frames that are most in doubt, by "
                f"{unlabelled.sign} of {unlabelled.variant}"
            )
            if unlabelled.sign not in RANKS_AT_ONCE:
                alone = "one method alone gives nothing to rank frames by"
                pictures = f"kept no pictures: {alone}"
            yield Sentence("without truth {output.record} {} {}", rule, pictures)
    if run.config.frames.labelled:
        yield (
            "only frames with truth were read: windows and flicker are of frames that follow each "
            "other among these, even if they are far apart"
        )
    if run.selection.truth is not None and not run.frames.accounting.labelled:
        stride = run.config.frames.every
        why = Sentence(": {frames.every} {} leaves out all frames that have it", stride)
        problem = "none of the frames that were read has road truth"
        remedy = Sentence("{frames.labelled} reads only frames that have it")
        yield Sentence("{}{}; {}", problem, why if stride > 1 else "", remedy)


def _pick_warnings(run: Run) -> Iterator[str]:
    """Yield how many picked frames are not labelled yet, and which labels were not picked."""
    picks, roles = run.schedule.picks, Counter(run.board.roles())
    if picks is None:
        return
    if problem := _why_not_random(run, picks):
        yield f"no number for the whole drive: {problem}"
    scored = roles[Role.EVALUATED]
    if (missing := picks.drawn - scored) > 0:
        rest = f"the number is from the other {scored}, and too low if the hard ones were left"
        rest = rest if scored else "there is no number"
        yield (
            f"{missing} of the {picks.drawn} frames that were drawn at random have no label yet: "
            f"{rest}"
        )
    picked = {frame.frame for frame in picks.picked}
    unread = len(picked & run.frames.accounting.undecodable.keys())
    used = (Role.PICKED, *([Role.TRAINING, Role.COPY] if run.model.source == "truth" else []))
    counted = scored + sum(roles[role] for role in used)
    if (unchanged := run.frames.accounting.labelled - counted - unread) > 0:
        yield (
            f"{unchanged} labels are as they were proposed, or ignored as a whole, and count as "
            f"not labelled; if one of them is right, empty its `proposal` in {PICK}"
        )
    if others := len(run.board.apart.keys() - picked):
        yield f"{others} labels are of frames that were not picked: they are in no number"


def _method_warnings(run: Run) -> Iterator[str]:
    """Yield which outputs are taken for probabilities, and where tuned methods have learnt."""
    for name, stages in run.methods.items():
        probable = stages.get("net", {}).get("taken_for") == "probabilities"
        if probable and not name.endswith(TUNED):
            taken = "the network's output is taken for probabilities, for it stays within 0 and 1"
            yield Sentence("{}: {}; if it holds logits, set {net.activation}", name, taken)
    settings, roles = run.config.training, Counter(run.board.roles())
    number = roles[Role.TRAINING]
    frames = "labelled frames" if run.model.source == "truth" else "frames, without labels"
    is_first = settings.placement == "first"
    here = (
        f"this drive's first {number} {frames}" if is_first else f"{number} {frames} of this drive"
    )
    where = here
    if settings.model is not None:
        where = f"other drives and {here}" if settings.adapt else f"other drives ({settings.model})"
    for variant in run.variants:
        if "threshold" in variant.pipeline.settings:
            yield f"{variant.name}: its threshold is the one with the fewest errors on {where}"
        elif variant.pipeline.heard_stages():
            method = variant.name.removesuffix(TUNED)
            yield (
                f"{variant.name}: learnt on {where}, on top of what {method} says: its rates are "
                f"not those of {method}" + (" on other drives" if "this drive" in where else "")
            )


def _mask_warnings(run: Run, totals: Totals) -> Iterator[str]:
    """Yield which masks of other systems are missing, belong to no frame, or are not disturbed."""
    account = run.frames.accounting
    for name, masks in run.selection.labels.items():
        if name in run.selection.masks and (missing := account.read - account.masks[name]):
            without = f"{name}: {missing} of the {account.read} frames read have no mask of it"
            rest = "it is scored on the others alone" if name in totals else "it has no score"
            yield f"{without}: {rest}"
        shown, where = name.removeprefix("/"), masks.where
        if unsure := masks.pairing.unsure:
            yield (
                f"{shown}: the last {unsure} frames of the log have no label of {where}: numbers "
                "pair them, and an unknown number of images or labels is lost before them"
            )
        if unused := masks.pairing.unused:
            yield f"{shown}: {unused} labels of {where} belong to no frame"
        notes = (*masks.notes, *masks.meaning.notes)
        yield from (Sentence("{}: {}: {}", shown, where, note) for note in notes)
    yield from run.frames.unpaired()
    names = [v.name for v in run.layouts if v.name not in run.disturbed_variants]
    if run.config.frames.disturb and not run.selection.truth:
        yield Sentence("{frames.disturb}: nothing is disturbed without truth to score against")
    elif run.config.frames.disturb and names:
        why = "because their masks were made of the undisturbed images"
        yield Sentence("{frames.disturb}: not for {}, {}", listing(names), why)


def _mask_facts(run: Run) -> dict[str, Any]:
    """State where labels lie that are not in the log, and how many frames have one."""
    masks, account = {}, run.frames.accounting
    for name, digest in run.selection.digests().items():
        source = run.selection.masks.get(name, run.selection.truth)
        assert source is not None
        masks[name] = {
            "path": run.config.masks.get(name, run.config.truth).path,
            "digest": digest,
            "pairing": source.why,
            "meaning": source.meaning.words,
            "frames": account.masks[name] if name in run.selection.masks else account.labelled,
        }
    return masks


def _account_for_frames(run: Run) -> FrameAccount:
    """Account for every frame of the image topic: evaluated, or skipped and why."""
    account, roles = run.frames.accounting, Counter(run.board.roles())
    labelled, is_first = run.config.frames.labelled, run.config.training.placement == "first"
    skipped = {
        "outside the range": account.in_log - account.in_range,
        f"not read ({'no truth, ' * labelled}stride or limit)": account.in_range - account.read,
        "undecodable": len(account.undecodable),
        "failed in a stage": account.read - len(account.undecodable) - sum(roles.values()),
        "trained on": roles[Role.TRAINING],
        "equal to a training frame": roles[Role.COPY],
        f"gap {'after' if is_first else 'beside'} training": roles[Role.GAP],
        "unlabelled": roles[Role.UNLABELLED],
        "picked": roles[Role.PICKED],
    }
    return FrameAccount(
        in_log=account.in_log,
        read=account.read,
        decoded=account.read - len(account.undecodable),
        labelled=account.labelled,
        trained_on=roles[Role.TRAINING],
        evaluated=roles[Role.EVALUATED],
        skipped={reason: number for reason, number in skipped.items() if number},
    )
