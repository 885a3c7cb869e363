"""The facts of a result: ``summary.json`` of a drive, ``fleet.json`` of many drives.

Both are read into one tree of types, checked, and written from it. ``digest`` holds a checksum of
the parts that are results, so that a changed number is damage.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Self

from pydantic import BeforeValidator, TypeAdapter, ValidationError

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.evaluation.score import Effect, final_stages
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference
from roadeval.results.tables import AGAIN, FLEET_FORMAT, ResultsError, TableFacts
from roadeval.runtime.documents import LONGEST, read_bounded, read_json
from roadeval.runtime.text import elided, visible, visible_lines

FORMAT: Final[Mapping[str, Any]] = {"name": "roadeval-summary", "version": 4}
SUMMARY: Final = "summary.json"
FLEET: Final = "fleet.json"
"""The file that makes a folder a fleet's; written last."""
VALUES: Final = 200_000
"""Values that are read of a summary; a run with two variants writes some two thousand."""
ALTERED: Final = "its content is not what was written"
MAKE: Final = "make it anew with roadeval replay"


def _with_mean(value: Any) -> Any:
    """Read an undefined mean, which JSON has as null, as NaN."""
    undefined = isinstance(value, dict) and value.get("mean", 0) is None
    return {**value, "mean": math.nan} if undefined else value


Totals = dict[str, dict[str, dict[str, Any]]]
"""Counts and rates by variant and stage; an undefined rate is NaN, or None where it was read."""
Differences = dict[str, dict[str, Annotated[Difference, BeforeValidator(_with_mean)]]]
"""Differences by stage or variant, then by rate."""


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """The drive: its log's name, its camera, and the topics that were read."""

    name: str
    camera: str = ""
    width: int = 0
    height: int = 0
    """Of the frames, in pixels."""
    rate_hz: float | None = None
    topics: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class FrameAccount:
    """What became of every frame of the image topic; None is unknown, as of a run that ended early.

    ``skipped`` counts the others by reason.
    """

    in_log: int | None = None
    read: int | None = None
    decoded: int | None = None
    labelled: int | None = None
    trained_on: int = 0
    evaluated: int = 0
    skipped: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TrainingFacts:
    """What the variants learnt from."""

    source: str | None = None
    frames: int = 0
    pixels: int = 0
    model: str | None = None
    placement: str | None = None
    adapted: bool = False


@dataclass(frozen=True, slots=True)
class LogFacts:
    """The log's file and the SHA-256 of its content."""

    path: str
    sha256: str


class _Facts:
    """What the facts of one drive and of many have in common."""

    run: dict[str, Any]

    @property
    def evaluation(self) -> EvaluationSettings:
        """The settings of the evaluation; the defaults where the run states none.

        Raises
        ------
        ResultsError
            If they are damaged.
        """
        given = self.run.get("evaluation", {})
        known = {each.name for each in fields(EvaluationSettings)}
        try:
            return EvaluationSettings(**{name: given[name] for name in known & {*given}})
        except (TypeError, ValueError) as error:
            raise ResultsError(
                "a summary is damaged (`run.evaluation` is not what it must be); make the results "
                "anew"
            ) from error


@dataclass(frozen=True)
class Facts(_Facts):
    """The facts of one drive: the content of ``summary.json``."""

    verdict: str
    drive: DriveFacts
    frames: FrameAccount
    totals: Totals
    """Empty where nothing was scored."""
    beyond: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Boundary F and flicker of each final mask."""
    curves: Totals = field(default_factory=dict)
    """Over all thresholds, by variant and stage that says how probable road is."""
    difference: Differences = field(default_factory=dict)
    """Filtered minus unfiltered, by stage."""
    against_unfiltered: Differences = field(default_factory=dict)
    against_blind: Differences = field(default_factory=dict)
    """Each other variant's final mask minus that of ``unfiltered`` or ``blind``, by variant."""
    seeds: dict[str, Any] = field(default_factory=dict)
    """The rates with each further seed of the training; empty with one."""
    oracles: dict[str, Totals] = field(default_factory=dict)
    """Totals where a stage was replaced by the truth."""
    windows: int = 0
    claims: dict[str, dict[str, int]] = field(default_factory=dict)
    """In how many windows each claim of the paper holds."""
    health: dict[str, dict[str, int]] = field(default_factory=dict)
    examples: list[int] = field(default_factory=list)
    """The frames of figure 2."""
    training: TrainingFacts = TrainingFacts()
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    """Mean time of a frame, by variant and stage."""
    warnings: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    """What was lost of the log, and frames on which a stage failed."""
    run: dict[str, Any] = field(default_factory=dict)
    """The configuration of the run."""
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The pipelines' settings, by variant."""
    methods: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """What stages say of themselves, as networks do."""
    versions: dict[str, str] = field(default_factory=dict)
    log: LogFacts | None = None
    """None of a run that ended early."""
    masks: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Masks of other systems that are not in the log."""
    tables: dict[str, TableFacts] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    """The files of the results folder; a recording has none."""

    RESULTS = (
        *("verdict", "frames", "totals", "beyond", "curves", "difference"),
        *("against_unfiltered", "against_blind", "seeds", "oracles", "windows", "claims"),
        *("health", "warnings", "losses", "settings", "methods"),
    )
    """Parts that are results, which ``digest`` covers. Whoever moves or renames files may mend what
    the others say of them."""
    OPTIONAL = ("curves", "seeds", "methods", "masks", "files")
    """Parts that are left out where they are empty."""

    @cached_property
    def finals(self) -> dict[str, str]:
        """Each scored variant's final stage."""
        return final_stages((name, stage) for name, own in self.totals.items() for stage in own)

    @cached_property
    def effects(self) -> list[Effect]:
        """The paired differences of the drive."""
        finals, found = self.finals, []
        for stage, rates in self.difference.items():
            final = finals[FILTERED] == stage
            base = finals[UNFILTERED] if final else stage
            found.append(Effect(UNFILTERED, base, FILTERED, stage, final, rates))
        for base, own in ((UNFILTERED, self.against_unfiltered), (BASELINE, self.against_blind)):
            found += [
                Effect(base, finals[base], name, finals[name], final=True, rates=rates)
                for name, rates in own.items()
            ]
        return found

    @property
    def sha256(self) -> str | None:
        """The SHA-256 of the log, where it is known."""
        return self.log.sha256 if self.log else None

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``summary.json``; undefined numbers become None."""
        content = asdict(self)
        known = {k: value for k, value in content.items() if value or k not in self.OPTIONAL}
        return _document(FORMAT, known, self.RESULTS)

    def text(self) -> str:
        """Return ``summary.json``."""
        return json_text(self.as_dict())

    @classmethod
    def parse(cls, text: str, where: object) -> Self:
        """Read the text of ``summary.json``.

        Raises
        ------
        ResultsError
            If it is damaged or of another format. ``where`` begins the message.
        """
        try:
            content = read_json(text, VALUES)
        except ValueError as error:
            raise ResultsError(f"{where}: not a summary ({error}); make it anew") from error
        _check_format(content, where)
        for part in ("verdict", "drive", "frames", "totals"):
            if part not in content:
                raise ResultsError(f"{where}: not a summary (it has no {part})")
        facts: Self = _typed(cls, content, where, MAKE)
        if not is_as_written(content):
            raise ResultsError(f"{where}: damaged ({ALTERED}); {MAKE}")
        return facts

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read ``summary.json``; a `ResultsError` if there is none, or as of `parse`."""
        try:
            text = read_bounded(path).decode()
        except OSError as error:
            raise ResultsError(
                f"{path.parent}: no results here ({SUMMARY}: {error.strerror}); "
                "make some with roadeval replay"
            ) from error
        except ValueError as error:
            raise ResultsError(f"{path}: not a summary ({error}); make it anew") from error
        return cls.parse(text, path)


def as_parts(effects: Iterable[Effect]) -> dict[str, Any]:
    """Return a drive's differences as the parts of `Facts` that hold them."""
    parts: dict[str, Differences] = {
        part: {} for part in ("difference", "against_unfiltered", "against_blind")
    }
    for each in effects:
        if each.base == BASELINE:
            parts["against_blind"][each.variant] = dict(each.rates)
        elif each.variant == FILTERED:
            parts["difference"][each.stage] = dict(each.rates)
        else:
            parts["against_unfiltered"][each.variant] = dict(each.rates)
    return parts


# --- Many drives ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Member:
    """A drive of a fleet, as its command names it."""

    drive: str
    """Its name in the fleet."""
    name: str
    source: str
    group: str | None = None
    tags: dict[str, str] = field(default_factory=dict)
    """As the columns of the table ``drives``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OverDrives(Difference):
    """The difference of a rate between two final masks, over drives."""

    base: str
    variant: str
    stage: str
    metric: str
    pooled: float | None = None
    """That of the rates of all pixels together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StratumFacts(Difference):
    """A difference of ERR over a part of the drives: of a tag, or of a third of the light."""

    base: str
    variant: str
    stage: str
    metric: str
    by: str
    value: str
    least: float | None
    most: float | None
    """The range of the light."""


@dataclass(frozen=True, slots=True)
class ConditionFacts:
    """A condition that was judged on each drive."""

    condition: str
    judged: int
    not_judged: dict[str, str]
    """Why not, by drive."""
    holds: dict[str, str]
    """What was found, by drive."""


@dataclass(frozen=True)
class FleetFacts(_Facts):
    """The facts of many drives: the content of ``fleet.json``."""

    verdict: str
    version: str
    """Of roadeval."""
    drives: list[Member]
    counts: dict[str, int]
    """Drives by status."""
    frames: int
    """Evaluated frames."""
    failed: dict[str, str]
    """Why drives failed."""
    rates: list[dict[str, Any]]
    """Of each final mask, a row: the mean over drives, and of all pixels together."""
    effects: list[Annotated[OverDrives, BeforeValidator(_with_mean)]]
    strata: list[Annotated[StratumFacts, BeforeValidator(_with_mean)]]
    warnings: list[str]
    conditions: list[ConditionFacts] = field(default_factory=list)
    run: dict[str, Any] = field(default_factory=dict)
    """The configuration of the fleet."""

    RESULTS = (
        "verdict",
        "counts",
        "frames",
        "rates",
        "effects",
        "strata",
        "conditions",
        "warnings",
    )

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``fleet.json``; undefined numbers become None."""
        return _document(FLEET_FORMAT, asdict(self), self.RESULTS)

    def text(self) -> str:
        """Return ``fleet.json``."""
        return json_text(self.as_dict())

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read ``fleet.json`` of a folder.

        Raises
        ------
        ResultsError
            If it is not there, damaged or of another format.
        """
        path = folder / FLEET
        try:
            content = read_json(read_bounded(path))
        except OSError as error:
            raise ResultsError(
                f"{folder}: no fleet here ({FLEET}: {error.strerror}); make one with roadeval fleet"
            ) from error
        except ValueError as error:
            raise ResultsError(f"{path}: damaged ({error}); {AGAIN}") from error
        check_fleet_format(path, content)
        facts: Self = _typed(cls, content, path, AGAIN)
        if not is_as_written(content):
            raise ResultsError(f"{path}: damaged ({ALTERED}); {AGAIN}")
        return facts


def is_fleet(path: str | Path) -> bool:
    """Return whether a path leads to a fleet's folder."""
    return (Path(path) / FLEET).is_file()


def check_fleet_format(path: Path, content: Any) -> None:
    """Raise a `ResultsError` unless the content of ``fleet.json`` is of this version's format."""
    form = content.get("format") if isinstance(content, dict) else None
    if form != FLEET_FORMAT:
        raise ResultsError(
            f"{path}: not of format {FLEET_FORMAT['name']} {FLEET_FORMAT['version']}: another "
            "version of roadeval made it; use that one, or another folder"
        )


# --- JSON -----------------------------------------------------------------------------------------


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _typed(kind: Any, content: Any, where: object, remedy: str) -> Any:
    """Read a document into its type; a `ResultsError` names the first part that does not fit."""
    try:
        return _adapter(kind).validate_python(content)
    except ValidationError as error:
        part = error.errors(include_url=False, include_input=False)[0]["loc"][0]
        raise ResultsError(
            f"{where}: damaged (`{part}` is not what it must be); {remedy}"
        ) from error


def _check_format(content: Any, where: object) -> None:
    form = content.get("format") if isinstance(content, dict) else None
    number = form.get("version") if isinstance(form, dict) else None
    if not isinstance(number, int) or form != {**FORMAT, "version": number}:
        raise ResultsError(f"{where}: not a summary of roadeval; {MAKE}")
    if number != FORMAT["version"] or "digest" not in content:
        versions = content.get("versions")
        made_by = versions.get("roadeval") if isinstance(versions, dict) else None
        sentence = another_format(made_by, later=number > FORMAT["version"])
        raise ResultsError(f"{where}: {sentence}")


def another_format(version: object, *, later: bool) -> str:
    """Return a sentence on results of another format, with the version that wrote them if known."""
    if later:
        made = (
            f"roadeval {visible(str(version))}, a later version" if version else "a later version"
        )
        return f"made by {made}: update roadeval"
    made = f"roadeval {visible(str(version))}" if version else "an earlier version of roadeval"
    return f"made by {made}, whose format is no longer read: replay the log again"


def _document(
    form: Mapping[str, Any], content: Mapping[str, Any], results: Iterable[str]
) -> dict[str, Any]:
    document = plain({"format": form, **content})
    return {**document, "digest": digest_of(document, results)}


def digest_of(content: Mapping[str, Any], parts: Iterable[str]) -> dict[str, Any]:
    """Return the ``digest`` of a JSON document: which parts it covers, and their SHA-256."""
    covered = [part for part in parts if part in content]
    text = json.dumps(
        {part: plain(content[part]) for part in covered}, allow_nan=False, sort_keys=True
    )
    return {"parts": covered, "sha256": hashlib.sha256(text.encode()).hexdigest()}


def is_as_written(content: Mapping[str, Any]) -> bool:
    """Return whether a document agrees with its ``digest``."""
    try:
        stated = content["digest"]
        return bool(stated == digest_of(content, stated["parts"]))
    except (TypeError, KeyError):  # the digest is damaged
        return False


def json_text(value: Any) -> str:
    """Write what JSON has as a document; characters that cannot be seen are escaped."""
    return visible_lines(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def plain(value: Any) -> Any:
    """Turn mappings, sequences, paths and undefined numbers into what JSON has.

    A long text, as of a topic's name, is shortened to what is read again.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    value = str(value) if isinstance(value, Path) else value
    return elided(value, LONGEST) if isinstance(value, str) and len(value) > LONGEST else value
