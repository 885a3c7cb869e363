"""The facts of a result: ``summary.json`` of a drive, ``fleet.json`` of many drives.

Each file is read into a tree of types, which is checked, and is written from that tree. ``digest``
is a checksum of the parts that are results, so a changed number is damage.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from difflib import get_close_matches
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar, Final, Self

from pydantic import TypeAdapter, ValidationError

from roadeval.data import BASELINE, FILTERED, TUNED, UNFILTERED, Calibration
from roadeval.data.words import listing
from roadeval.errors import RoadevalError
from roadeval.evaluation.score.degradation import Degradations
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.stats.sampling import Estimate
from roadeval.evaluation.stats.slices import Slice
from roadeval.evaluation.tables import final_stages
from roadeval.geometry.ground import Ground
from roadeval.results.tables import AGAIN, FLEET_FORMAT, ResultsError, TableFacts
from roadeval.runtime.documents import LONGEST, VALUES, read_bounded, read_json
from roadeval.runtime.text import elide, visible, visible_lines

SUMMARY: Final = "summary.json"
FLEET: Final = "fleet.json"
"""The file that makes a folder a fleet's; it is written last."""
DRIVE_RESULTS: Final = "results"
"""The folder in a fleet's with the results of its drives."""
ADAPTER_OF: Final = cache(TypeAdapter)
FETCHED: Final[dict[Path, str]] = {}
"""Public URLs of results that were fetched, by their paths."""


def focus_of(variants: Iterable[str], chosen: str | None = None) -> str | None:
    """Return the variant that a result is about: the chosen one, else the first that was brought.

    If the user brought no variant, it is the first one; None if there is no variant. A
    `RoadevalError` if the chosen one is not there.

    >>> focus_of(["filtered", "unfiltered", "mine", "mine_tuned", "blind"])
    'mine'
    >>> focus_of(["filtered", "unfiltered", "mine"], "unfiltered")
    'unfiltered'
    """
    names = [name for name in variants if name != BASELINE]
    if chosen and chosen not in names:
        choices = f"there {'are' if len(names) > 1 else 'is'} {listing(names) or 'none'}"
        likely = get_close_matches(chosen, names, 1)
        remedy = f"did you mean {likely[0]}? {choices.capitalize()}" if likely else choices
        raise RoadevalError(f"there is no variant {chosen}", setting="output.focus", remedy=remedy)
    brought = [name for name in names if name not in (FILTERED, UNFILTERED)]
    return chosen or next(iter([*brought, *names]), None)


Totals = dict[str, dict[str, dict[str, Any]]]
"""Counts and rates by variant and stage; an undefined rate is NaN, or None once it is read."""


@dataclass(frozen=True)
class DriveFacts:
    """The drive: its log's name, its camera, and the topics that were read."""

    name: str
    camera: str = ""
    width: int = 0
    height: int = 0
    """Size of the frames in pixels."""
    rate_hz: float | None = None
    start_ns: int | None = None
    end_ns: int | None = None
    """Header stamps of the first and the last evaluated frame."""
    topics: list[str] = field(default_factory=list)
    calibration: Calibration | None = None
    ground: Ground | None = None
    """The camera's calibration and the ground in front of it, for images of this size."""


@dataclass(frozen=True)
class FrameAccount:
    """The number of frames of the image topic; None means unknown (the run ended early).

    ``skipped`` counts by reason the frames that were not evaluated.
    """

    in_log: int | None = None
    read: int | None = None
    decoded: int | None = None
    labelled: int | None = None
    trained_on: int = 0
    evaluated: int = 0
    skipped: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class TrainingFacts:
    """The data that the variants learnt from."""

    source: str | None = None
    frames: int = 0
    pixels: int = 0
    model: str | None = None
    placement: str | None = None
    adapted: bool = False


@dataclass(frozen=True)
class UnlabelledFacts:
    """The frames without truth: which of them to look at, and how far masks differ."""

    frames: int
    variant: str
    sign: str | None
    """The sign of doubt that ranks the variant's frames, if any, see `unlabelled.SIGNS`."""
    look_at: list[int]
    """Numbers of the frames that rank first, one for each scene."""
    differing: dict[str, dict[str, float]]
    """The mean share of pixels on which two variants differ, by the names of both."""


@dataclass(frozen=True)
class EstimateFacts:
    """Rates of a whole drive from frames that were drawn at random, picked by `roadeval pick`."""

    frames: int
    """All frames that could be picked."""
    drawn: int
    labels: int
    """Frames that were drawn at random, and the number of them that are labelled and scored."""
    probability: float
    """Probability that a frame is drawn."""
    rates: dict[str, dict[str, Estimate]]
    """Rates of final masks by variant and name; empty if there is a problem."""
    apart: dict[str, dict[str, float | None]]
    """ERR of the frames that were picked by rank and train no model, by frame and variant; they are
    not in the rates."""
    problem: str = ""
    """Reason why there are no rates."""


@dataclass(frozen=True)
class LogFacts:
    """The log's file, and the digest that identifies it (`roadeval.logs.log.Log.digest`)."""

    path: str
    digest: str


@dataclass(frozen=True)
class Reason:
    """A sentence on the errors of a variant, and frames that are examples of it."""

    sentence: str
    frames: list[int]

    @property
    def text(self) -> str:
        """The sentence with the numbers of the frames.

        >>> Reason("All is dark.", [3, 50]).text
        'All is dark; see frames 3, 50.'
        """
        word = "frames" if len(self.frames) > 1 else "frame"
        numbers = f"; see {word} {', '.join(map(str, self.frames))}" if self.frames else ""
        return f"{self.sentence.removesuffix('.')}{numbers}."


@dataclass(frozen=True)
class Origin:
    """The origin of a result; many results are sorted by it."""

    made_ns: int | None = None
    """End of the run, in Unix nanoseconds."""
    commit: str = ""
    """Git's commit of the repository in which the command ran; empty without one."""
    dirty: bool = False
    """Whether tracked files differed from it."""
    labels: dict[str, str] = field(default_factory=dict)
    """The labels that ``--label`` gave it."""


class FactsFile:
    """A JSON file of facts, with its format and a checksum."""

    FORMAT: ClassVar[Mapping[str, Any]]
    AGAIN: ClassVar[str]
    """Advice on how to make a damaged file again."""
    RESULTS: ClassVar[tuple[str, ...]]
    """The parts that are results, which ``digest`` covers. The others may change when files are
    moved or renamed."""
    OPTIONAL: ClassVar[tuple[str, ...]] = ()
    """Parts that are left out if they are empty."""
    VALUES: ClassVar[int] = VALUES
    """Greatest number of values that are read."""
    totals: Totals
    effects: list[Effect]
    misfits: list[str]
    disturbances: Degradations
    run: dict[str, Any]

    @cached_property
    def finals(self) -> dict[str, str]:
        """Each scored variant's final stage."""
        return final_stages((name, stage) for name in self.totals for stage in self.totals[name])

    @cached_property
    def final_totals(self) -> dict[str, dict[str, Any]]:
        """Counts and rates of each scored variant's final mask."""
        return {name: self.totals[name][stage] for name, stage in self.finals.items()}

    @property
    def focus(self) -> str | None:
        """The scored variant that the result is about; None if nothing was scored."""
        output = self.run.get("output")
        chosen = output.get("focus") if isinstance(output, Mapping) else None
        return focus_of(self.finals, chosen if chosen in [*self.finals] else None)

    @property
    def final_effects(self) -> list[Effect]:
        """The differences of final masks."""
        return [effect for effect in self.effects if effect.final]

    def as_dict(self) -> dict[str, Any]:
        """Return the content of the file; undefined numbers become None."""
        parts = {k: part for k, part in self.content().items() if part or k not in self.OPTIONAL}
        document = plain({"format": self.FORMAT, **parts})
        return {**document, "digest": digest_of(document, self.RESULTS)}

    def content(self) -> dict[str, Any]:
        """Return the parts of the file."""
        return asdict(self)  # type: ignore[call-overload]

    @classmethod
    def read_content(cls, content: Any) -> Any:
        """Return the parts of a file as the fields have them."""
        return content

    def text(self, *, packed: bool = False) -> str:
        """Return the text of the file, one line without spaces if ``packed``."""
        return json_text(self.as_dict(), packed=packed)

    @classmethod
    def parse(cls, text: str | bytes, where: object) -> Self:
        """Read the text of a file from ``where``, which begins the message of an error.

        A `ResultsError` if it is damaged or of another format.
        """
        try:
            content = read_json(text, cls.VALUES)
        except ValueError as error:
            raise cls._damage(where, error) from error
        check_format(content, cls.FORMAT, where)
        try:
            facts: Self = ADAPTER_OF(cls).validate_python(cls.read_content(content))  # type: ignore[arg-type]
        except ValidationError as error:
            wrong = [e["loc"][0] for e in error.errors(include_url=False, include_input=False)]
            part = next((name for name in wrong if name in content), wrong[0])
            part = "difference" if part == "effects" and part not in content else part
            raise cls._damage(where, f"`{part}` is not what it must be") from error
        with suppress(TypeError, KeyError, ValueError):  # the digest or a number may be damaged
            if content["digest"] == digest_of(content, content["digest"]["parts"]):
                return facts
        raise cls._damage(where, "its content is not what was written")

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file; a `ResultsError` if it does not exist, or `parse` raises one."""
        try:
            return cls.parse(read_bounded(path), path)
        except OSError as error:
            raise ResultsError(
                f"no results here ({path.name}: {error.strerror})",
                where=path.parent,
                remedy=_find_results(path.parent),
            ) from error
        except ValueError as error:
            raise cls._damage(path, error) from error

    @property
    def evaluation(self) -> EvaluationSettings:
        """The settings of the evaluation, by default the settings of this version.

        A `ResultsError` if they are damaged.
        """
        stated = self.run.get("evaluation", {})
        names = {setting.name for setting in fields(EvaluationSettings)}
        try:
            return EvaluationSettings(**{name: stated[name] for name in names & {*stated}})
        except (TypeError, ValueError) as error:
            what = "`run.evaluation` is not what it must be"
            raise self._damage("a summary", what) from error

    @classmethod
    def _damage(cls, where: object, what: object) -> ResultsError:
        return ResultsError(f"{where}: damaged ({what}); {cls.AGAIN}")


@dataclass(frozen=True)
class Facts(FactsFile):
    """The facts of one drive: the content of ``summary.json``."""

    verdict: str
    drive: DriveFacts
    frames: FrameAccount
    totals: Totals
    """It is empty if nothing was scored."""
    beyond: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Numbers of each final mask beyond its rates: edges, flicker, error episodes."""
    curves: Totals = field(default_factory=dict)
    """Key figures over all thresholds, by variant and stage with a probability of road."""
    thresholds: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The thresholds on the probability of road of variants that learn nothing: ``own`` is in use,
    ``threshold`` is best on the training frames, ``ERR`` is the rate of all evaluated pixels at
    ``threshold``, and ``lines`` are the settings that set it."""
    effects: list[Effect] = field(default_factory=list)
    """The paired differences of the drive."""
    oracles: dict[str, Totals] = field(default_factory=dict)
    """Totals with a stage replaced by the truth."""
    disturbances: Degradations = field(default_factory=dict)
    """ERR of final masks on disturbed frames, by variant and disturbance."""
    why: dict[str, list[Reason]] = field(default_factory=dict)
    """Reasons for the errors of each variant, see `roadeval.results.why.explain`."""
    misfits: list[str] = field(default_factory=list)
    """Sentences on truth or masks that do not fit the images; the verdict begins with them."""
    slices: dict[str, list[Slice]] = field(default_factory=dict)
    """The conditions under which a variant errs more. A variant is missing if it was not searched,
    for example because it has too few frames."""
    windows: int = 0
    kitti: Totals = field(default_factory=dict)
    """Rates of KITTI's road benchmark by variant and category; empty for other drives."""
    claims: dict[str, dict[str, int]] = field(default_factory=dict)
    """Number of windows in which each claim of the paper holds."""
    health: dict[str, dict[str, int]] = field(default_factory=dict)
    examples: list[int] = field(default_factory=list)
    """The frames of figure 2."""
    training: TrainingFacts = TrainingFacts()
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    """Mean time of a frame, by variant and stage."""
    warnings: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    """Losses of the log, and frames on which a stage failed."""
    run: dict[str, Any] = field(default_factory=dict)
    """The configuration of the run."""
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The pipelines' settings, by variant."""
    methods: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Facts that stages state about themselves, as networks do."""
    versions: dict[str, str] = field(default_factory=dict)
    unlabelled: UnlabelledFacts | None = None
    """It is None if every frame has truth."""
    estimate: EstimateFacts | None = None
    """Rates of the whole drive, if picked frames are the truth."""
    log: LogFacts | None = None
    """It is None after a run that ended early."""
    masks: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Labels that are not in the log: masks of other systems by their variant, and ``truth``."""
    tables: dict[str, TableFacts] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    """The files of the results folder; a recording has none."""
    cameras: dict[str, Facts] = field(default_factory=dict)
    """The facts of each camera of a rig, by its name."""
    origin: Origin | None = None
    """It is None in older results, and in a recording, which does not state its time."""

    FORMAT = {"name": "roadeval-summary", "version": 4}  # noqa: RUF012
    AGAIN = "make it again with roadeval replay"
    VALUES = 200_000  # a run with two variants writes some two thousand
    RESULTS = (
        *("verdict", "frames", "totals", "beyond", "curves", "thresholds", "difference"),
        *("against_unfiltered", "against_blind", "against_method", "oracles"),
        *("windows", "claims", "health", "warnings", "losses", "settings", "methods"),
        *("cameras", "unlabelled", "estimate", "misfits", "disturbances", "slices", "why", "kitti"),
    )
    OPTIONAL = (
        *("against_method", "curves", "thresholds", "methods", "masks", "files", "kitti"),
        *("cameras", "unlabelled", "estimate", "misfits", "disturbances", "slices", "why"),
        "origin",
    )

    def content(self) -> dict[str, Any]:
        """Return the parts of the file, with differences by the variant that is subtracted.

        ``difference`` is filtered minus unfiltered, by stage. The other parts hold, by variant, the
        final mask minus the final mask of ``unfiltered``, ``blind``, or the method that was tuned.
        """
        names = "difference", "against_unfiltered", "against_blind", "against_method"
        parts: dict[str, dict[str, Any]] = {name: {} for name in names}
        for effect in self.effects:
            part, key = "against_unfiltered", effect.variant
            if effect.base == BASELINE:
                part = "against_blind"
            elif effect.variant == effect.base + TUNED:
                part = "against_method"
            elif effect.variant == FILTERED:
                part, key = "difference", effect.stage
            parts[part][key] = {rate: asdict(change) for rate, change in effect.rates.items()}
        cameras = {name: facts.content() for name, facts in self.cameras.items()}
        content: dict[str, Any] = {}
        for name, part in (asdict(self) | {"cameras": cameras}).items():
            content |= parts if name == "effects" else {name: part}
        return content

    @classmethod
    def read_content(cls, content: Any) -> Any:
        """Return a file's content with its differences as effects."""
        names = "base", "variant", "stage", "final", "rates"
        against = {"unfiltered": UNFILTERED, "blind": BASELINE, "method": ""}
        try:
            totals = content["totals"].items()
            finals = final_stages((name, stage) for name, stages in totals for stage in stages)
            effects: list[tuple[Any, ...]] = [
                (UNFILTERED, FILTERED, stage, stage == finals[FILTERED], rates)
                for stage, rates in content["difference"].items()
            ]
            for name, base in against.items():
                for variant, rates in content.get(f"against_{name}", {}).items():
                    of = base or variant.removesuffix(TUNED)
                    effects.append((of, variant, finals[variant], True, rates))
            cameras = content.get("cameras", {}).items()
            return {
                **content,
                "effects": [dict(zip(names, effect, strict=True)) for effect in effects],
                "cameras": {name: cls.read_content(facts) for name, facts in cameras},
            }
        except (AttributeError, KeyError, TypeError):
            return {**content, "effects": None}  # the parts tell what is wrong

    @property
    def log_digest(self) -> str | None:
        """The digest that identifies the log, if it is known."""
        return self.log.digest if self.log else None


@dataclass(frozen=True)
class Member:
    """A drive of a fleet, as its command names it."""

    drive: str
    """Its name in the fleet."""
    name: str
    source: str
    group: str | None = None
    tags: dict[str, str] = field(default_factory=dict)
    """Values by tag; each tag is a column of the table ``drives``."""


@dataclass(frozen=True)
class StratumFacts:
    """A difference of ERR between two final masks, over the drives that have a value of a tag."""

    base: str
    variant: str
    tag: str
    value: str
    difference: Difference


@dataclass(frozen=True)
class FleetFacts(FactsFile):
    """The facts of many drives: the content of ``fleet.json``."""

    verdict: str
    version: str
    """Version of roadeval."""
    drives: list[Member]
    counts: dict[str, int]
    """Drives by status."""
    frames: int
    """Evaluated frames."""
    failed: dict[str, str]
    """Reasons why drives failed."""
    totals: Totals
    """Rates of each final mask: the mean over drives, and from all pixels together."""
    effects: list[Effect]
    """The differences of final masks: within the drive if there is only one, else over drives."""
    strata: list[StratumFacts]
    warnings: list[str]
    run: dict[str, Any] = field(default_factory=dict)
    """The configuration of the fleet."""
    misfits: list[str] = field(default_factory=list)
    """Sentences on drives with truth or masks that do not fit; the verdict begins with them."""
    disturbances: Degradations = field(default_factory=dict)
    """ERR of final masks on disturbed frames, over drives."""
    why: dict[str, list[Reason]] = field(default_factory=dict)
    """The reasons are as in `Facts`."""
    slices: dict[str, list[Slice]] = field(default_factory=dict)
    """The slices are as in `Facts`, over groups of drives."""
    origin: Origin | None = None
    """The origin of the last run; None in older results."""

    FORMAT = FLEET_FORMAT
    AGAIN = AGAIN
    RESULTS = (
        *("verdict", "counts", "frames", "totals", "effects", "strata", "warnings", "misfits"),
        *("disturbances", "slices", "why"),
    )
    OPTIONAL = ("misfits", "disturbances", "slices", "why", "origin")


def _find_results(folder: Path) -> str:
    """Return what to do about a folder without results, as a clause."""
    if (folder / DRIVE_RESULTS).is_dir():
        return "if it is of a fleet that was stopped, give the same roadeval fleet command again"
    below = sorted(path.parent for name in (SUMMARY, FLEET) for path in folder.glob(f"*/{name}"))
    if below:
        return f"name a folder in it, as {visible(str(below[0]))}"
    return "make some with roadeval replay, or roadeval fleet"


def is_fleet(path: str | Path) -> bool:
    """Return whether a path leads to a fleet's folder."""
    return (Path(path) / FLEET).is_file()


def check_format(content: Any, form: Mapping[str, Any], where: object) -> None:
    """Raise a `ResultsError` unless the content of a file is of a format."""
    stated = content.get("format") if isinstance(content, dict) else None
    number = stated.get("version") if isinstance(stated, dict) else None
    if not isinstance(number, int) or stated != {**form, "version": number}:
        raise ResultsError(f"{where}: not of format {form['name']}; make the results again")
    if number != form["version"] or "digest" not in content:
        versions = content.get("versions", {"roadeval": content.get("version")})
        made_by = versions.get("roadeval") if isinstance(versions, dict) else None
        remedy = "use a new folder" if form == FLEET_FORMAT else "replay the log again"
        problem = another_format(made_by, later=number > form["version"], remedy=remedy)
        raise ResultsError(f"{where}: {problem}")


def another_format(version: object, *, later: bool, remedy: str = "replay the log again") -> str:
    """Return a sentence on results of another format, with the version that wrote them if known."""
    made_by = f"roadeval {visible(str(version))}"
    if later:
        made_by = f"{made_by}, a later version" if version else "a later version"
        return f"made by {made_by}: update roadeval"
    made_by = made_by if version else "an earlier version of roadeval"
    return f"made by {made_by} in a format that is no longer read: {remedy}"


def digest_of(content: Mapping[str, Any], parts: Iterable[str]) -> dict[str, Any]:
    """Return the ``digest`` of a JSON file: the parts that it covers, and their SHA-256."""
    covered = [part for part in parts if part in content]
    text = json.dumps({part: content[part] for part in covered}, allow_nan=False, sort_keys=True)
    return {"parts": covered, "sha256": hashlib.sha256(text.encode()).hexdigest()}


def json_text(value: Any, *, packed: bool = False) -> str:
    """Return a value of JSON as the text of a file, indented, or one line without spaces.

    Invisible characters are escaped.
    """
    form = {"separators": (",", ":")} if packed else {"indent": 2}
    return visible_lines(json.dumps(value, ensure_ascii=False, allow_nan=False, **form)) + "\n"


def plain(value: Any) -> Any:
    """Return mappings, sequences, paths and undefined numbers as values of JSON.

    A text is shortened to the length that can be read again.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    value = str(value) if isinstance(value, Path) else value
    return elide(value, LONGEST) if isinstance(value, str) and len(value) > LONGEST else value
