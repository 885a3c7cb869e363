"""The history of many results: which rate got worse in which run, and what changed then."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.words import first_of, setting
from roadeval.errors import RoadevalError, check_count
from roadeval.evaluation.comparison import history as search
from roadeval.evaluation.comparison.compare import changed_settings
from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.comparison.pairing import common_masks
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference, within_drive
from roadeval.evaluation.tables import (
    KEY,
    MASK,
    concatenate,
    finals,
    group_rows,
    most_changed_frames,
    only,
)
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.result import Result, local_path
from roadeval.report.history import document, markdown
from roadeval.report.writing import write_document
from roadeval.results.facts import FLEET, SUMMARY, Facts, Origin, json_text, plain
from roadeval.results.history import Event, History, RunFacts, as_dict, group_changes
from roadeval.results.schema import TAG
from roadeval.results.tables import read_parquet, read_table
from roadeval.runtime.files import Paths, list_paths
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    import pandas as pd

EARLIER: Final = 7
"""Number of runs before the last one; conditions compare the last one with their mean."""
DETAILED: Final = 5
"""Number of newest events with named frames."""
FRAMES: Final = 5
DRIVES: Final = 3
"""Number of frames that are named for an event, and of drives in which they are searched."""
NEAR: Final = 10
"""Number of runs on each side of a step; their frames are compared if there is one drive."""
BATCH: Final = 30
"""Number of results that have their tables in memory together."""
COLUMNS: Final[Mapping[str, Sequence[str]]] = {
    "scores": (*KEY, *MASK, "final", "region", "frames", "TP", "FN", "N", "truth", *search.RATES),
    "drives": (*KEY, "name", "log_digest", "group", "status"),
    "classes": (*KEY, "variant", "class", "name", "truth", "pixels", "road", "frames"),
}
"""Columns that are read of each table of a fleet."""
RUN_KEY: Final = ["run", *KEY]
"""Columns that name a drive of a run."""


@dataclass(frozen=True)
class Listing:
    """The results below some places, listed once."""

    places: Sequence[tuple[Path, Sequence[Path]]]
    """Each place with its results: the place itself, or the results below the folder."""
    errors: Sequence[RoadevalError] = ()
    """The reasons why other places have none."""

    @property
    def paths(self) -> list[Path]:
        """The paths of all results."""
        return [path for _, results in self.places for path in results]


class TooFewRunsError(RoadevalError):
    """There are fewer than two runs; the error has the readable runs, and why others are lost."""

    def __init__(self, runs: Sequence[RunFacts], lost: Sequence[str]) -> None:
        problem = f"a history needs two runs, and there is {len(runs) or 'none'}"
        super().__init__(problem, remedy=next(iter(lost), ""))
        self.runs, self.lost = runs, lost


ReadFrames = Callable[[int, tuple[str, str]], "pd.DataFrame"]
"""Returns the rows of ``frames`` of final masks, in a run by its number, on a drive."""


def history(
    results: Paths | Listing,
    *,
    by: str | None = None,
    last: int = EARLIER,
    fail_if: Sequence[str] = (),
    on_progress: OnProgress = ignore,
) -> History:
    """Read many results as one history, and find which rate changed in which run.

    A `RoadevalError` if fewer than two of them can be read; the history lists the others.

    Parameters
    ----------
    results
        Results of drives or fleets, or folders with any number of them below.
    by
        A label (see ``--label``): results that share its value are one run. By default each is a
        run. Runs are in the order in which they were made.
    last
        Number of runs before the last one; ``fail_if`` compares it with their mean.
    fail_if
        Conditions on the last run, see `roadeval.evaluation.comparison.conditions`.
    """
    check_count("last", last)
    conditions = [Condition.parse(text) for text in fail_if]
    listing = list_results(results)
    lost: list[str] = [error.sentence for error in listing.errors]
    origins: dict[Path, Origin] = {}
    drives: dict[Path, Result] = {}  # the facts of hundreds of fleets would fill the memory
    for path in listing.paths:
        try:
            result = Result(path)
            if not result.complete:
                raise RoadevalError("a partial recording, which is left out", where=path)
        except RoadevalError as error:
            lost.append(error.sentence)
            continue
        origin = result.facts.origin or Origin()
        file = path if path.is_file() else path / (FLEET if result.fleet else SUMMARY)
        made_ns = min(max(origin.made_ns or file.stat().st_mtime_ns, 0), 2**63 - 1)
        labels = {visible(name): visible(text) for name, text in origin.labels.items()}
        origins[path] = replace(
            origin, made_ns=made_ns, commit=visible(origin.commit), labels=labels
        )
        if result.fleet is None:
            drives[path] = result
    runs = _runs_in_order(origins, by, lost)
    if len(runs) < 2:
        raise TooFewRunsError(runs, lost)
    rows = _read_rows(runs, drives, lost, on_progress)
    masks = only(rows, kind=ALL).drop_duplicates(RUN_KEY).groupby("run")["frames"]
    sizes = masks.agg(["size", "sum"]).reindex(range(len(runs)), fill_value=0).to_numpy().tolist()
    runs = [replace(run, drives=n, frames=m) for run, (n, m) in zip(runs, sizes, strict=True)]
    newest = Result(([run for run in runs if run.drives] or runs)[-1].paths[0]).facts
    settings, focus = newest.evaluation, newest.focus or ""
    tags = {str(name): str(name)[len(TAG) :] for name in rows if str(name).startswith(TAG)}
    lines = search.find_lines(rows, tags, len(runs), settings.confidence)
    logs = {*rows[[*KEY, "log_digest"]].drop_duplicates().itertuples(index=False, name=None)}
    read = lru_cache(4 * NEAR)(partial(_read_frames, runs, logs))
    within = partial(_within_drive, read, settings)
    events = [
        replace(event, reasons=[*_reasons(runs, event)] or ["nothing that the results know of"])
        for event in group_changes(search.find_changes(lines, settings.confidence, within), focus)
    ]
    for event in events[-DETAILED:]:
        event.frames.extend(_changed_frames(read, event))
    judged = search.judge_last(lines, conditions, last, settings, within)
    return History(runs, lines, events, focus, [*judged], [*dict.fromkeys(lost)])


def list_results(results: Paths | Listing) -> Listing:
    """Return the results at some places, or below them; a listing is returned unchanged."""
    if isinstance(results, Listing):
        return results
    places, errors = list[tuple[Path, Sequence[Path]]](), list[RoadevalError]()
    for place in list_paths(results):
        try:
            path = local_path(place)
            places.append((path, find_results(path)))
        except RoadevalError as error:
            errors.append(error)
    return Listing(places, errors)


def find_results(path: Path) -> list[Path]:
    """Return the path of a result, or the paths of the results below a folder, but not in links.

    Recordings count only if there is no folder of results. A `RoadevalError` if there is none.
    """
    if not path.is_dir() or (path / SUMMARY).is_file() or (path / FLEET).is_file():
        return [path]
    folders, recordings = [], []
    for folder, below, files in os.walk(path):
        below.sort()
        if SUMMARY in files or FLEET in files:
            folders.append(Path(folder))
            below.clear()
        recordings += [Path(folder, name) for name in sorted(files) if name.endswith(".rrd")]
    if not (folders or recordings):
        remedy = "put a first one there, or name a recording, a results folder or a fleet"
        raise RoadevalError("holds no results", where=path, remedy=remedy)
    return folders or recordings


def last_good(listing: Listing, on_progress: OnProgress = ignore) -> tuple[Path, Sequence[str]]:
    """Return the result of the first place, or its newest run before a lasting step to worse.

    Results of the other places are not runs of the folder. The runs that could not be read are
    returned, too, and why. A `RoadevalError` if none can be read.
    """
    (place, runs), *others = listing.places
    taken = {path.resolve() for path in Listing(others).paths}
    paths = [path for path in runs if path.resolve() not in taken]
    if len(paths) < 2:
        return (paths or [place])[0], ()
    try:
        past = history(paths, on_progress=on_progress)
    except TooFewRunsError as error:
        if not error.runs:
            raise RoadevalError(
                "no run of it can be read", where=place, remedy=error.remedy
            ) from error
        return Path(error.runs[0].paths[0]), error.lost
    return Path(past.last_good.paths[0]), past.lost


def _runs_in_order(
    origins: Mapping[Path, Origin], by: str | None, lost: list[str]
) -> list[RunFacts]:
    """Return the runs by time; results without the label ``by`` are lost."""
    groups: dict[str, list[tuple[Origin, str]]] = {}
    pairs = [(origin, str(path)) for path, origin in origins.items()]
    for origin, path in sorted(pairs, key=lambda pair: (pair[0].made_ns, pair[1])):
        if by and by not in origin.labels:
            lost.append(f"{path}: has no label {by}")
        else:
            groups.setdefault(origin.labels[by] if by else path, []).append((origin, path))
    firsts = [members[0][0] for members in groups.values()]
    times = [datetime.fromtimestamp((origin.made_ns or 0) / 1e9, UTC) for origin in firsts]
    forms = ("%Y-%m-%d", "%Y-%m-%d %H:%M", "%Y-%m-%d %H:%M:%S")
    distinct = (form for form in forms if len({f"{time:{form}}" for time in times}) == len(times))
    form = next(distinct, forms[-1])
    titles = [*groups] if by else [f"{time:{form}}" for time in times]
    times_before = [titles[:place].count(title) for place, title in enumerate(titles)]
    titles = [f"{t} ({n + 1})" if n else t for t, n in zip(titles, times_before, strict=True)]
    paths = [tuple(path for _, path in members) for members in groups.values()]
    return [RunFacts(*run) for run in zip(paths, firsts, titles, strict=True)]


def _read_rows(
    runs: Sequence[RunFacts],
    drives: Mapping[Path, Result],
    lost: list[str],
    on_progress: OnProgress,
) -> pd.DataFrame:
    """Return the rows for `find_lines`; the results of the runs are ``drives`` and fleets.

    If a run has a drive twice, the later result counts.
    """
    paths = [Path(path) for run in runs for path in run.paths]
    run_of = np.array([number for number, run in enumerate(runs) for _ in run.paths])
    parts: list[pd.DataFrame] = []
    for begin in range(0, len(paths), BATCH):
        on_progress(Progress(begin, len(paths), "reading", unit="results"))
        batch = [*enumerate(paths[begin : begin + BATCH], begin)]
        groups = [[run for run in batch if run[1] not in drives]]
        groups += [[run] for run in batch if run[1] in drives]
        tables = {
            name: [table for runs in groups for table in _read_batch(runs, drives, name, lost)]
            for name in COLUMNS
        }
        if any(map(len, tables["scores"])):
            tables["classes"].append(read_table("classes", "").assign(run=0))
            parts.append(_join_tables(*map(concatenate, tables.values())))
    if not parts:
        raise RoadevalError(lost[0] if lost else "nothing was scored in any of the runs")
    rows = concatenate(parts)
    rows = rows.assign(run=run_of[rows["run"]])
    if len(paths) == len(runs):
        return rows
    logs = rows[[*RUN_KEY, "log_digest"]].drop_duplicates()
    names = logs[logs.duplicated(RUN_KEY)]["drive"].unique()
    lost += [f"two logs of a run are called {n}: only the later result counts" for n in names]
    return rows[~rows.duplicated([*RUN_KEY, "variant", "kind", "part"], keep="last")]


def _read_batch(
    batch: Sequence[tuple[int, Path]], drives: Mapping[Path, Result], name: str, lost: list[str]
) -> Iterator[pd.DataFrame]:
    """Yield a table of one drive, or of fleets, which are read together unless one is damaged."""
    if name == "classes":  # older fleets lack this table
        batch = [run for run in batch if run[1] in drives or (run[1] / "classes.parquet").is_file()]
    numbers, paths = [number for number, _ in batch], [path for _, path in batch]
    is_scores = name == "scores"
    try:
        if paths and paths[0] in drives:
            rows = drives[paths[0]].table(name).assign(run=numbers[0])
        else:
            files, flag = [path / f"{name}.parquet" for path in paths], "final" * is_scores
            rows = read_parquet(files, name, COLUMNS[name], numbers, flag)
        yield rows[rows["final"] & (rows["variant"] != BASELINE)] if is_scores else rows
    except RoadevalError as error:
        if len(batch) == 1:
            lost.append(error.sentence)
        else:
            yield from chain(*(_read_batch([run], drives, name, lost) for run in batch))


def _join_tables(scores: pd.DataFrame, drives: pd.DataFrame, classes: pd.DataFrame) -> pd.DataFrame:
    """Return the rows for `find_lines` from tables of all results; ``run`` numbers the results."""
    import pandas as pd

    is_class = classes["truth"].isin(["road", "other"]) & (classes["variant"] != BASELINE)
    classes = classes[is_class & (classes["pixels"] > 0)]
    right = classes["road"] / classes["pixels"]
    wrong = right.where(classes["truth"] == "other", 1 - right)
    numbers = group_rows(classes, ["class", "name"]).ngroup()
    pairs = classes[["class", "name"]].drop_duplicates().astype("str").to_numpy()
    names = pd.Categorical([name or f"class {number}" for number, name in pairs]).take(numbers)
    kinds = pd.Categorical([ALL, "region", "class"])
    of_classes = classes.assign(part=names, ERR=wrong, N=classes["pixels"])
    of_classes["kind"] = kinds[np.full(len(classes), 2)]
    of_masks = scores.assign(part=scores["region"], road=scores["TP"] + scores["FN"])
    of_masks["kind"] = kinds[(scores["region"] != ALL).to_numpy(int)]
    logs = drives[[*RUN_KEY, "log_digest", "group", *drives.filter(regex=f"^{TAG}")]]
    logs = logs.merge(
        only(scores, region=ALL)[[*RUN_KEY, "truth"]].drop_duplicates(RUN_KEY), on=RUN_KEY
    )
    # A fleet, its folder elsewhere and a replay alone call a log by other names.
    copies = logs.duplicated(["run", "camera", "log_digest"], keep=False)
    has_log = logs["log_digest"].astype(object).fillna("") != ""
    logs["source"] = logs["drive"].astype(object).mask(has_log & ~copies, "")
    for other in ("log_digest", "drive"):
        logs["group"] = logs["group"].astype(object).fillna(logs[other].astype(object))
    logs["group"] = logs["group"].astype("category")
    columns = [*RUN_KEY, "variant", "stage", "kind", "part", "frames", "road", "N", *search.RATES]
    parts = [part.reindex(columns=columns) for part in (of_masks, of_classes) if len(part)]
    rows = concatenate(parts) if len(parts) > 1 else parts[0]
    # If the categories differ, a merge turns them into texts.
    rows = rows.merge(logs.astype({name: rows[name].dtype for name in KEY}), on=RUN_KEY)
    return rows.assign(pixels=search.number_pixels(rows)).drop(
        columns=["source", "truth", "road", "N"]
    )


def _read_frames(
    runs: Sequence[RunFacts], logs: Set[tuple[str, ...]], run: int, drive: tuple[str, str]
) -> pd.DataFrame:
    """Return the rows of ``frames`` of final masks on a drive; none if they are gone.

    A run that calls the drive by another name has it by its log: ``logs`` are drives, cameras and
    their logs.
    """
    tables = [read_table("frames", "")]
    for path in runs[run].paths:
        with suppress(RoadevalError):
            result = Result(path)
            drives = [d for d in result.compared if d.camera == drive[1]]
            keys = [d.key for d in drives if d.key == drive]
            keys += [d.key for d in drives if (*drive, d.digest) in logs]
            tables.append(result.table("frames", keys[:1]).assign(drive=drive[0]))
    return finals(concatenate(tables))


def _within_drive(
    read: ReadFrames, settings: EvaluationSettings, line: search.Line, *sides: Sequence[int]
) -> Difference:
    """Return the change of a line within its only drive, over frames, as `Within` does."""
    (drive,) = line.drives[KEY].itertuples(index=False, name=None)
    means = []
    for runs in (sides[0][-NEAR:], sides[1][:NEAR]):
        rows = concatenate([only(read(run, drive), variant=line.variant) for run in runs])
        means.append(rows.groupby(["camera", "stamp_ns"], observed=True)[line.rate].mean())
    pairs = means[0].to_frame(f"{line.rate}_base").join(means[1], how="inner").reset_index()
    return within_drive(pairs, line.rate, settings)


def _changed_frames(read: ReadFrames, event: Event) -> Iterator[tuple[str, int, float]]:
    """Yield drive, number and change of the frames that changed most from the run before."""
    line, worse = event.first.line, event.first.difference.mean > 0
    for drive in event.first.drives[KEY].head(DRIVES).itertuples(index=False, name=None):
        sides = (only(read(run, drive), variant=line.variant) for run in (event.before, event.run))
        pairs = common_masks(*sides)
        pairs = pairs.assign(change=pairs[TESTED] - pairs[f"{TESTED}_base"])
        rows = most_changed_frames(pairs, FRAMES, harmed=worse)
        yield from zip(rows["drive"], rows["frame"], rows["change"], strict=True)


def _reasons(runs: Sequence[RunFacts], event: Event) -> Iterator[str]:
    """Yield what differs between the run of an event, or the end of a drift, and the one before."""
    step, line = event.first.step, event.first.line
    places = event.before, step.after if step.kind == "drift" else event.run
    old, new = (runs[place] for place in places)
    before, after = Result(*old.paths), Result(*new.paths)
    parts: dict[str, tuple[Any, Any]] = {
        "commit": (old.origin.commit[:12], new.origin.commit[:12]),
        "uncommitted changes": (old.origin.dirty, new.origin.dirty),
    }
    with suppress(RoadevalError):  # one of several results may be damaged
        digests = {(d.digest, d.camera): d for d in before.compared}
        keys = {d.key: d for d in before.compared}
        pairs = [(keys.get(d.key) or digests.get((d.digest, d.camera)), d) for d in after.compared]
        parts |= changed_settings([(base, new) for base, new in pairs if base])
    stated = [
        {f"label {name}": value for name, value in run.origin.labels.items()}
        | (facts.versions if isinstance(facts, Facts) else {"roadeval": facts.version})
        for run, facts in ((old, before.facts), (new, after.facts))
    ]
    parts |= {name: (stated[0].get(name), value) for name, value in stated[1].items()}
    yield from (f"{k} {setting(a)} to {setting(b)}" for k, (a, b) in parts.items() if a != b)
    had, has = (~np.isnan(line.drive_rates[place]) for place in places)
    names = line.drives["drive"].to_numpy()
    added, removed, common = (set(names[there]) for there in (has & ~had, had & ~has, had & has))
    for title, drive_names in (
        ("new drives", added - removed),
        ("drives that are gone", removed - added),
        ("drives with other frames or another truth", (added & removed) - common),
    ):
        if drive_names:
            yield f"{title}: {first_of(sorted(drive_names), DRIVES)}"


def write(history: History, path: Path) -> Path:
    """Write a history as PDF, page, Markdown or JSON, by the file's ending.

    A `RoadevalError` if the ending is another, or the file cannot be written.
    """
    return write_document(
        *(path, "a history", partial(document, history)),
        *(partial(markdown, history), partial(as_json, history)),
    )


def as_json(history: History) -> str:
    """Write a history as JSON; undefined numbers become null."""
    return json_text(plain(as_dict(history)))
