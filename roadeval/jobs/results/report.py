"""The report of a result, as a PDF or as a page, and what it shows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows, as_plain
from roadeval.data.result import Cells
from roadeval.data.words import short_names
from roadeval.errors import RoadevalError
from roadeval.evaluation import score
from roadeval.evaluation.metres import band_name
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import TESTED
from roadeval.evaluation.stats import mean_distribution
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.results.frames import FramePicker, browsed, evenly, strips_of
from roadeval.jobs.results.result import DriveResult, Result, RigResult
from roadeval.report.blocks import Document, ImageFile
from roadeval.report.charts.standard import BEHIND, WRONG, Interval
from roadeval.report.document import document, page_document
from roadeval.report.findings import (
    Commands,
    Findings,
    FleetFindings,
    PairedComparison,
    Row,
    WorstPicture,
)
from roadeval.report.page.render import Beside, page, write_page
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.facts import Facts
from roadeval.results.fleet import FleetFolder
from roadeval.results.rows import as_arrays, window_rows
from roadeval.results.tables import parquet_rows
from roadeval.runtime.files import leads_outside

PAGES: Final = (".html", ".htm")
"""Endings of files that are written as a page."""
WORST_OF_FLEET: Final = 12
"""Worst frames that are shown."""
PICTURED_OF_FLEET: Final = 60
"""Worst frames of a fleet that a page shows."""


@dataclass(frozen=True, slots=True)
class PageSettings:
    """The settings of a page."""

    pictures: int | None = None
    """Frames with pictures; by default as many as keep the page of a drive below 10 MB."""
    assets: bool = False
    """Whether script, style and pictures lie in a folder beside it."""


def write_report(
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    paper: Paper = Paper.A4,
    commands: Commands | None = None,
    as_page: PageSettings = PageSettings(),
    on_progress: OnProgress = ignore,
) -> Path:
    """Write the report of a drive, or of a fleet, as a PDF or as a page for a browser.

    A `RoadevalError` if there is nothing to read there, or the file cannot be written.

    Parameters
    ----------
    result
        A recording, whole or partial, a results folder, or a fleet's folder; or one of these opened
        already. Without a recording there are no pictures of a single drive.
    output
        By default ``report.pdf`` in the folder, or ``reports/<recording>.pdf``. A name that ends
        in ``.html`` gives a page.
    commands
        What the reader may type for more; none by default.
    on_progress
        Called with each pictured frame of a page.
    """
    opened = result if isinstance(result, Result) else Result(result)
    (source,) = opened.paths
    own = opened.drive.camera if opened.drive else ""
    camera = f"-{as_plain(own)}" if own else ""
    usual = Path("reports", f"{source.stem}{camera}.pdf") if opened.recording else None
    path = Path(output or usual or _beside(source, camera))
    with holding(path, inputs=[source]):
        if not is_page(path):
            return write_file(path, pdf(document(findings_of(opened, commands)), paper))
        kept = Beside.PICTURES if opened.fleet else Beside.NOTHING
        made = page_of(opened, commands, as_page.pictures, on_progress)
        return write_page(path, made, Beside.ALL if as_page.assets else kept)


def findings_of(
    result: Result, commands: Commands | None, worst: int = WORST_OF_FLEET
) -> Findings | FleetFindings:
    """Collect what the report of a result shows, with so many of a fleet's worst frames."""
    if result.rig:
        return collect_rig(result.rig, commands)
    if result.fleet:
        return collect_fleet(result.fleet, commands.inspect if commands else None, worst)
    assert result.drive is not None
    return collect(result.drive, commands)


def _beside(folder: Path, camera: str) -> Path:
    """Return where the report of a folder lies; its other files may come from someone else."""
    path = folder / f"report{camera}.pdf"
    if leads_outside(path, folder):
        raise RoadevalError(f"{path}: a link leads out of the folder; name the file to write")
    return path


def is_page(path: Path) -> bool:
    """Return whether a file's name asks for a page."""
    return path.suffix.lower() in PAGES


def page_of(
    result: Result,
    commands: Commands | None = None,
    pictures: int | None = None,
    on_progress: OnProgress = ignore,
) -> Document:
    """Return the page of a result as a document, with so many pictured frames.

    Of a drive by default as many as `roadeval.jobs.results.frames.strips_of` says.
    """
    findings = findings_of(result, commands, pictures or PICTURED_OF_FLEET)
    if result.drive is None:
        return page_document(findings, None)
    drive, inspect = result.drive, commands.inspect if commands else None
    frames = browsed(drive, inspect)
    taken = len(page(page_document(findings, frames))) if pictures is None else 0
    strips, left_out = strips_of(drive, inspect, pictures, taken, on_progress)
    return page_document(findings, replace(frames, strips=strips, left_out=left_out))


SAMPLED: Final = 100
"""Frames whose masks are read for how much they cover, at most, where there is no truth."""
WINDOWS: Final = 30
"""Points of the figures over the drive, at most."""
EXAMPLES: Final = 4
THUMBNAILS: Final = 4
"""Frames in figure 2 and on the first page."""


def collect(result: DriveResult, commands: Commands | None = None) -> Findings:
    """Collect everything that the report of a result shows."""
    rows, facts = result.rows, result.facts
    evaluated = set(result.rows["frame"].tolist()) or set(result.pictured)
    pictured = [number for number in result.pictured if number in evaluated]
    changes, heat = result.table("changes"), result.table("heat")
    paired = list(_paired(result, changes))
    picker = FramePicker(result)
    worst, drawn = picker.worst(), facts.examples
    return Findings(
        source=str(result.path),
        complete=result.complete,
        commands=commands,
        viewable=commands is not None and result.viewable is not None,
        pictured=len(pictured),
        facts=facts,
        properties=result.properties,
        windows=_windows(result),
        paired=paired,
        regions=score.by_region(result.table("regions")) if len(rows) else {},
        overlap=_overlap(facts),
        changes=_stage_changes(changes),
        error_parts=picker.error_parts(),
        heatmaps={name: _heatmap(heat.of_variant(name)) for name in heat.distinct("variant")},
        oracles=[*score.perfect_stages(result.table("oracles"), rows)],
        levels=result.table("probabilities"),
        examples=picker.examples(
            drawn if drawn and set(drawn) <= set(result.pictured) else evenly(pictured, EXAMPLES)
        ),
        thumbnails=picker.thumbnails(evenly(pictured, THUMBNAILS)),
        worst=worst,
        helped=picker.moved(paired, [], harmed=False),
        harmed=picker.moved(paired, worst, harmed=True),
        coverage=_coverage(result, pictured),
        behind=dict(_behind(rows, score.finals(result.table("regions")))) if len(rows) else {},
        camera=result.camera,
        metres=result.table("metres"),
        by_distance=dict(_by_distance(result)) if len(rows) else {},
    )


def _by_distance(result: DriveResult) -> Iterator[tuple[tuple[str, str], Interval]]:
    """Yield the mean ERR of each final mask in each band of distance, with its interval."""
    rows, settings = score.finals(result.table("regions")), result.facts.evaluation
    bands = [band_name(*ends) for ends in pairwise(settings.distances)]
    for variant in rows.distinct("variant"):
        own = rows.of_variant(variant)
        for band in bands:
            there = own.take((own["region"] == band) & (own["N"] > 0))
            errors = (there["FP"] + there["FN"]) / there["N"]
            if len(errors):
                low = high = None
                if len(errors) >= settings.least_frames and np.ptp(errors):
                    low, high = mean_distribution(errors).interval(settings.confidence)
                yield (band, variant), (float(errors.mean()), low, high)


def collect_rig(rig: RigResult, commands: Commands | None = None) -> Findings:
    """Collect everything that the report of several cameras shows."""
    facts, of_camera = rig.facts, commands and commands.of_camera
    own = {e.camera: collect(e, of_camera and of_camera(e.camera)) for e in rig.cameras}
    names = short_names([*own])
    nothing = as_arrays("windows", ())
    pairs = [each for each in facts.effects if each.final]
    return Findings(
        source=str(rig.path),
        complete=all(each.complete for each in own.values()),
        commands=commands,
        viewable=False,
        pictured=sum(each.pictured for each in own.values()),
        facts=facts,
        properties={},
        windows=nothing,
        paired=[PairedComparison(e.variant, e.base, e.rates, nothing) for e in pairs],
        regions={},
        overlap=_overlap(facts),
        changes={},
        error_parts={},
        heatmaps={},
        oracles=[],
        levels=as_arrays("probabilities", ()),
        examples=[],
        thumbnails=[
            replace(image, title=f"{names[camera]}, {image.title}")
            for camera, each in own.items()
            for image in each.thumbnails[:1]
        ],
        worst=[],
        helped=[],
        harmed=[],
        coverage={},
        cameras=own,
    )


def _overlap(facts: Facts) -> dict[str, dict[str, dict[str, float]]]:
    return {
        variant: {stage: score.overlap(total) for stage, total in stages.items()}
        for variant, stages in facts.totals.items()
    }


def _behind(rows: Rows, regions: Rows) -> Iterator[tuple[tuple[str, str, str], list[int]]]:
    """Yield the frames behind the rates of every mask, and behind the errors in every region."""

    def most(frames: Cells, values: Cells) -> list[int]:
        ranked = np.argsort(-np.nan_to_num(values), kind="stable")[:BEHIND]
        found: list[int] = frames[ranked[values[ranked] > 0]].tolist()
        return found

    for variant, stage, places in rows.masks():
        own = rows.take(places)
        for rate, metric in SHORT.items():
            values = 1 - own[rate] if metric.higher_is_better else own[rate]
            yield (variant, stage, rate), most(own["frame"], values)
    for variant in regions.distinct("variant"):
        own = regions.of_variant(variant)
        for region in own.distinct("region"):
            there = own.take(own["region"] == region)
            yield (variant, region, WRONG), most(there["frame"], there["FP"] + there["FN"])


def _windows(result: DriveResult) -> Rows:
    """Return the drive's windows; longer ones where the drive is long."""
    size, windows = result.facts.evaluation.window, result.table("windows")
    count = -(-len(result.rows.distinct("frame")) // size)
    if not count or (count <= WINDOWS and len(windows)):
        return windows
    size *= -(-count // WINDOWS)
    return as_arrays("windows", window_rows(score.windows(result.rows, size)))


def _paired(result: DriveResult, changes: Rows) -> Iterator[PairedComparison]:
    """Compare the variants with unfiltered, then with the baseline."""
    for each in result.facts.effects:
        if each.final:
            between = (changes["from_variant"] == each.base) & (changes["N"] > 0)
            own = changes.take(between & (changes["to_variant"] == each.variant))
            columns = (own[name].tolist() for name in ("repaired", "spoiled", "N"))
            pixels = next(zip(*columns, strict=True), None)
            paired = score.pairs(result.rows, each.variant, each.base)
            yield PairedComparison(each.variant, each.base, each.rates, paired, pixels)


def _stage_changes(changes: Rows) -> dict[tuple[str, str], tuple[float, float]]:
    """Return what stages changed, as shares of labelled pixels."""
    known = (changes["from_variant"] == changes["to_variant"]) & (changes["N"] > 0)
    own = changes.take(known)
    masks = zip(own["to_variant"].tolist(), own["to_stage"].tolist(), strict=True)
    shares = ((own[name] / own["N"]).tolist() for name in ("repaired", "spoiled"))
    return dict(zip(masks, zip(*shares, strict=True), strict=True))


def _heatmap(cells: Rows) -> npt.NDArray[np.float64]:
    """Spread the cells of a variant's heat map; NaN where none was labelled."""
    rows, columns = (cells[edge] // cells["side"][0] for edge in ("top", "left"))
    shares = np.full((2, rows.max() + 1, columns.max() + 1), np.nan)
    for share, outcome in zip(shares, ("FP", "FN"), strict=True):
        share[rows, columns] = cells[outcome] / cells["labelled"]
    return shares


def _coverage(result: DriveResult, numbers: Sequence[int]) -> dict[str, dict[int, float]]:
    """Return without truth how much of the image each final mask covers."""
    if result.recording is None or len(result.rows):
        return {}
    return {
        variant.name: {
            number: np.nan if mask is None else float(np.mean(mask == 1))
            for number in evenly(numbers, SAMPLED)
            for mask in [result.layer(variant.name, variant.stages[-1], number)]
        }
        for variant in result.recording.variants
    }


_EFFECTS: Final = [
    *("drive", "base", "variant", "stage", "final", "metric"),
    *("mean", "low", "high", "p", "frames"),
]


def collect_fleet(
    fleet: FleetFolder, inspect: Callable[[int], str] | None = None, worst: int = WORST_OF_FLEET
) -> FleetFindings:
    """Collect what the report of a fleet is made of.

    ``inspect`` returns the command that opens one of the ``worst`` frames, by its rank. A
    `ResultsError` if a table cannot be read.
    """
    scores, regions = _scores(fleet)
    from pyarrow import compute

    table = fleet.table("effects", _EFFECTS)
    wanted = compute.and_(table["final"], compute.equal(table["metric"], TESTED))
    found: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in table.filter(wanted).to_pylist():
        if row["mean"] is not None:
            found[row["base"], row["variant"]].append(row)
    return FleetFindings(
        name=fleet.name,
        source=str(fleet.path),
        facts=fleet.facts,
        drives=fleet.drives,
        names=fleet.names,
        effects=dict(found),
        regions=regions,
        scores=scores,
        worst=list(_worst(fleet, worst)),
        inspect=inspect,
    )


def _scores(fleet: FleetFolder) -> tuple[list[Row], dict[tuple[str, str], dict[str, float]]]:
    """Return the first variant's final rows of ``scores``, and the regions of all drives."""
    from pyarrow import compute

    rates = fleet.facts.rates
    if not rates:
        return [], {}
    table = fleet.table("scores")
    table = table.filter(table["final"])
    whole = compute.equal(table["region"], ALL)
    first = compute.equal(table["variant"], rates[0]["variant"])
    rows: list[Row] = table.filter(compute.and_(whole, first)).to_pylist()
    return rows, score.by_region(parquet_rows(table.filter(compute.invert(whole)), "scores"))


def _worst(fleet: FleetFolder, count: int) -> Iterator[WorstPicture]:
    for rank, row in enumerate(fleet.table("worst").to_pylist()[:count], 1):
        rates = {name: row[name] for name in ("ERR", "FPR", "FNR")}
        yield WorstPicture(rank, row["drive"], row["frame"], rates, _picture(fleet.path, row))


def _picture(folder: Path, row: dict[str, Any]) -> ImageFile | None:
    """Read a picture of the folder; one from elsewhere, or of another kind, is none."""
    path = folder / (row["picture"] or "")
    if not path.resolve().is_relative_to(folder.resolve()):
        return None
    try:
        content = path.read_bytes()
    except OSError:
        return None
    whole = content.startswith(b"\xff\xd8\xff") and content.rstrip(b"\0").endswith(b"\xff\xd9")
    return ImageFile(content) if whole else None
