"""Frames worth labelling: chosen from a result, and written for an annotation tool."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from roadeval.config.run import RunConfig, run_toml
from roadeval.errors import RoadevalError, check_count
from roadeval.evaluation.score.unlabelled import choose_frames, sign_of
from roadeval.evaluation.tables import only, values_of
from roadeval.images.decoding import png_of
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.logs.truth.formats.coco import as_coco
from roadeval.logs.truth.picks import IMAGES, LABELS, PICK, PROPOSALS, Picked, Picks, Why, digest_of
from roadeval.logs.truth.shapes import Proposal
from roadeval.results.facts import SUMMARY, is_fleet
from roadeval.results.fleet import FleetFolder, recording_path
from roadeval.results.folder import RUN
from roadeval.runtime.files import AnyPath, Paths, list_paths, put, writing
from roadeval.runtime.text import likely, visible
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

PNG: Final = "png"
COCO: Final = "coco"
"""The formats of masks: images, 255 where there is road and 128 where nothing counts; or COCO."""


@dataclass(frozen=True)
class PickedFrames:
    """The frames that a command has picked."""

    folder: Path
    picks: Picks
    """All frames that were picked so far."""
    new: int
    """Frames to label that this command has added."""
    log: str
    """The place of the log."""
    config: Path
    """The file for ``--config`` that repeats its replay: the recording, or ``run.toml`` beside the
    picks of a log that was replayed here."""

    @property
    def added(self) -> list[Picked]:
        """The frames that this command has added."""
        return self.picks.picked[len(self.picks.picked) - self.new :]


def pick(
    source: Paths,
    count: int,
    folder: AnyPath,
    config: RunConfig | None = None,
    *,
    labels: str = PNG,
    variant: str | None = None,
    seed: int = 0,
    on_progress: OnProgress = ignore,
) -> list[PickedFrames]:
    """Pick frames of logs without truth to label: half drawn at random, half most in doubt.

    Parameters
    ----------
    source
        A recording or the results folder beside it; a log, which is replayed first; a fleet's
        folder, with the recordings that it has kept; or several of these.
    count
        Number of frames to label; several drives share it by their lengths.
    folder
        Folder of the frames; each of several drives has a folder of its name in it. If it holds
        picks already, new frames are added: no frame comes twice.
    config
        Configuration for the replay of a log.
    labels
        Format of the present masks that are written for correction: ``png`` or ``coco``.
    variant
        Variant with the masks and the doubt; by default the first one.
    seed
        Random seed of the drawing; existing picks keep theirs.

    Raises
    ------
    RoadevalError
        If nothing can be picked; its text says what to do.
    """
    check_count("count", count)
    check_count("seed", seed, least=0)
    check_format(labels)
    sources = list_paths(source)
    if not sources:
        raise RoadevalError("nothing to pick from: name a result, a log or a fleet")
    with TemporaryDirectory(prefix="roadeval-") as place:
        drives = open_drives(sources, Path(place), config or RunConfig(), on_progress)
        many = len(drives) > 1
        names = [drive.name for _, drive, _ in drives]
        if len({*names}) < len(names):
            raise RoadevalError("two drives have the same name; pick from each into its own folder")
        lengths = [drive.table("unlabelled")["frame"].nunique() for _, drive, _ in drives]
        picked = []
        for (path, drive, run), share in zip(drives, _share_out(lengths, count), strict=True):
            if share:
                target = Path(folder, *[drive.name] * many)
                picks, new = _pick_frames(drive, path, share, target, variant=variant, seed=seed)
                _write_picks(drive, picks, new, target, labels=labels, run=run)
                log = drive.facts.log.path if drive.facts.log else drive.name
                repeats = target / RUN if run else drive.path
                picked.append(PickedFrames(target, picks, len(new), log, repeats))
        return picked


def open_drives(
    sources: Sequence[AnyPath], place: Path, config: RunConfig, on_progress: OnProgress
) -> list[tuple[Path, DriveResult, str | None]]:
    """Open the recordings of some results; a log is replayed into a folder.

    Return the path and the result of each, and the configuration of a log that was replayed.
    """
    from roadeval.jobs.run.replay import replay

    drives = []
    masks = config.override({"output": {"record": "masks", "figures": False}})
    for number, path in enumerate(part for name in sources for part in find_recordings(Path(name))):
        file, run = path, None
        if path.suffix != ".rrd":
            file, run = Path(place, f"{number}.rrd"), run_toml(config, path.name, VERSION)
            replay(path, masks, save=file, reports=Path(place, "reports"), on_progress=on_progress)
        drive = Result(file).drive
        if drive is None or drive.recording is None:
            raise RoadevalError(
                f"{file}: this command takes a recording of one camera; give the log, and "
                "of several cameras one with --image-topic"
            )
        drives.append((path, drive, run))
    if not drives:
        raise RoadevalError(f"{sources[0]}: no recording was kept; replay it with --keep all")
    return drives


def find_recordings(source: Path) -> list[Path]:
    """Return the recordings of a fleet or of a results folder; another path is returned itself."""
    if not is_fleet(source):
        if not (source / SUMMARY).is_file():
            return [source]
        result = DriveResult(source)
        if result.viewable is None:
            problem = f"its recording is not at {visible(str(result.written))}"
            remedy = "name the recording, or work in the folder of the replay"
            if result.facts.run.get("output", {}).get("record") == "none":
                problem, remedy = "its replay made no recording", "replay without --record none"
            raise RoadevalError(problem, where=source, remedy=remedy)
        return [result.viewable]
    drives = FleetFolder(source).drives
    return [path for name in drives.index if (path := recording_path(source, name)).exists()]


def _share_out(sizes: Sequence[int], count: int) -> list[int]:
    """Share a number out in proportion to sizes, by the largest remainders.

    >>> _share_out([100, 50, 51], 10)
    [5, 2, 3]
    """
    exact = np.array(sizes) * count / max(sum(sizes), 1)
    shares = np.floor(exact).astype(int)
    shares[np.argsort(shares - exact, kind="stable")[: count - shares.sum()]] += 1
    return shares.tolist()


NewPicks = list[tuple[Picked, npt.NDArray[np.bool_]]]
"""Frames that were picked now, each with its mask to correct."""


def _pick_frames(
    drive: DriveResult, source: Path, count: int, folder: Path, *, variant: str | None, seed: int
) -> tuple[Picks, NewPicks]:
    """Pick frames of a recording for a folder; return all picks, and the new ones.

    ``source`` is the log or the recording that was named.
    """
    rows = drive.table("unlabelled")
    names = values_of(rows, "variant")
    if not names:
        raise RoadevalError(f"{source}: every frame has truth, or none was replayed")
    if (name := variant or names[0]) not in names:
        choice = f"{likely(name, names)}there are {', '.join(names)}"
        raise RoadevalError(f"no variant {name}", where=source, remedy=choice)
    doubts = only(rows, variant=name)
    picks_before = _begin_picks(drive, folder, doubts, source, seed)
    scores = picks_before.every_score()
    if (sign := sign_of(doubts)) is not None:  # the present doubt replaces the earlier one
        doubt_of = dict(zip(map(float, doubts["stamp_ns"]), doubts[sign], strict=True))
        scores = np.array([doubt_of.get(float(stamp), np.nan) for stamp in picks_before.stamps])
    taken = [picks_before.places[stamp] for stamp in picks_before.by_stamp]
    stamps = np.array(picks_before.stamps, np.int64)
    places = choose_frames(
        stamps, scores, count, picks_before.seed, drawn=picks_before.drawn, taken=taken
    )
    random, ranked = (numbers.tolist() for numbers in places)
    frames = [picks_before.frames[place] for place in {*random, *ranked} - {*taken}]
    if lacking := sorted({*frames} - {*drive.pictured}):
        raise RoadevalError(
            f"{source}: no pictures of frame {lacking[0]}; replay with --record masks"
        )
    (stage, *_), masks = doubts["stage"], {}
    for frame in frames:
        mask = drive.layer(name, stage, frame)
        assert mask is not None
        masks[frame] = mask == 1
    digests = {frame: digest_of(mask) for frame, mask in masks.items()}
    picks, new = _add_picks(picks_before, random, ranked, digests)
    return picks, [(frame, masks[frame.frame]) for frame in new]


def _begin_picks(
    drive: DriveResult, folder: Path, rows: pd.DataFrame, source: Path, seed: int
) -> Picks:
    """Return the picks that a folder holds; if there are none yet, picks without a frame.

    These have the frames of a result that can be picked, and their doubt: ``rows`` of one variant.
    """
    log, camera = drive.facts.log_digest, drive.facts.drive.camera
    if (picks := Picks.read(folder)) is not None:
        if (picks.log, picks.camera) != (log, camera):
            problem = "its frames are of another log; name a folder of its own"
            raise RoadevalError(f"{folder}: {problem}")
        return picks
    # Files that a killed run has left are written again.
    leftovers = {*folder.rglob("*")} if folder.exists() else set()
    begun = {folder / IMAGES, folder / PROPOSALS, folder / LABELS, folder / RUN}
    begun |= {file for file in leftovers if re.fullmatch(r"\d{19}\.png", file.name)}
    proposed = {file for file in leftovers if folder / PROPOSALS in file.parents}
    labels = {file for file in leftovers if folder / LABELS in file.parents}
    if labels or leftovers - begun - proposed:
        raise RoadevalError(f"{folder}: holds something else; name a folder of its own")
    stamps, sign = rows["stamp_ns"].tolist(), sign_of(rows)
    if len({*stamps}) < len(stamps):
        raise RoadevalError(
            f"{source}: several frames have one stamp, so labels cannot name their frames"
        )
    doubts = rows[sign].tolist() if sign else [np.nan] * len(rows)
    (variant,), identity = values_of(rows, "variant"), drive.properties.get("input")
    return Picks(
        drive=drive.name,
        camera=camera,
        log=log,
        method={"variant": variant, "ranked_by": sign, "identity": identity},
        seed=seed,
        drawn=0,
        frames=rows["frame"].tolist(),
        stamps=stamps,
        scores=[doubt if np.isfinite(doubt) else None for doubt in doubts],
        picked=[],
    )


def _write_picks(
    drive: DriveResult, picks: Picks, new: NewPicks, folder: Path, *, labels: str, run: str | None
) -> None:
    """Write images and masks to correct, and at the end the picks.

    ``run`` is the configuration, as TOML, of a log that was replayed here; a recording has None.
    """
    recording = drive.recording
    assert recording is not None
    with writing(folder, RoadevalError):
        for part in (IMAGES, PROPOSALS, LABELS):
            (folder / part).mkdir(parents=True, exist_ok=True)
        proposals = []
        for frame, mask in new:
            name = f"{frame.stamp_ns:019d}.png"
            (folder / IMAGES / name).write_bytes(png_of(recording.image(frame.frame)))
            proposals.append(Proposal(name, mask))
        for name, content in proposal_files(proposals, labels).items() if new else ():
            path = folder / PROPOSALS / name
            wave = new[0][0].wave if path.exists() else ""
            path.with_name(f"{wave}{name}").write_bytes(content)
        if run:
            put(folder / RUN, run.encode())
        put(folder / PICK, picks.text().encode())


def check_format(labels: str) -> None:
    """Raise a `RoadevalError` if masks to correct are not written in this format."""
    if labels not in (PNG, COCO):
        raise RoadevalError(f"labels must be {PNG} or {COCO} (given: {labels!r})")


def proposal_files(proposals: Sequence[Proposal], labels: str) -> dict[str, bytes]:
    """Return the files with masks to correct, by their names."""
    if labels != PNG:
        return as_coco(proposals)
    return {proposal.image: png_of(proposal.levels) for proposal in proposals}


def _add_picks(
    picks: Picks, random: Sequence[int], ranked: Sequence[int], proposals: Mapping[int, str]
) -> tuple[Picks, list[Picked]]:
    """Add frames to the picks; return all picks, and the new ones in the drive's order.

    A frame that was ranked before, and is drawn now, becomes a random one.
    """
    drawn = picks.drawn + len(random)
    wave = max((earlier.wave for earlier in picks.picked), default=0) + 1
    probability, stamps = drawn / len(picks.stamps), {picks.stamps[place] for place in random}
    old = [
        replace(earlier, why=Why.RANDOM, probability=probability)
        if earlier.why is Why.RANDOM or earlier.stamp_ns in stamps
        else earlier
        for earlier in picks.picked
    ]
    new = []
    for place in sorted({*random, *ranked}):
        if float(stamp := picks.stamps[place]) not in picks.by_stamp:
            why, chance = (Why.RANDOM, probability) if place in random else (Why.RANKED, None)
            frame = picks.frames[place]
            details = why, chance, picks.scores[place], proposals[frame], wave
            new.append(Picked(frame, stamp, *details))
    return replace(picks, drawn=drawn, picked=[*old, *new]), new
