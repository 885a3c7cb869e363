"""Arguments that several commands share, and the configuration that options describe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from roadeval.cli.options import FLAGS, OptionValues, with_flags
from roadeval.errors import RoadevalError

if TYPE_CHECKING:
    from roadeval.config.run import RunConfig
    from roadeval.config.variants import Variant
    from roadeval.jobs.results.result import Result as Result_


def option(flags: str, text: str, metavar: str | None = None, **more: Any) -> Any:
    """Return an option with its help; a file is checked when it is opened."""
    return typer.Option(*flags.split(), help=text, metavar=metavar, readable=False, **more)


def argument(metavar: str, text: str) -> Any:
    """Return an argument with its help."""
    return typer.Argument(metavar=metavar, help=text, show_default=False, readable=False)


Drive = Annotated[str, argument("DRIVE", "A camera log (MCAP), or its URL.")]
NewLog = Annotated[Path, option("-o --output", "File of the log.", "DRIVE.mcap")]
Result = Annotated[str, argument("RESULT", "A recording, a results folder, a fleet, or a URL.")]
LabelFormat = Annotated[
    Literal["png", "coco"], option("--format", "Format of the labels to correct.")
]
Json = Annotated[bool, option("--json", "Print the result on stdout as JSON.")]
Quiet = Annotated[bool, option("-q --quiet", "No progress and no tables; warnings remain.")]


def ending_in(*endings: str, unnamed: tuple[str, ...] = ()) -> Callable[[Any], Any]:
    """Return an option's callback that refuses paths with other endings.

    The ``unnamed`` endings are allowed, too, but the message does not propose them.
    """

    def check(paths: Any) -> Any:
        for path in paths if isinstance(paths, list) else filter(None, [paths]):
            if path.suffix.lower() not in (*endings, *unnamed):
                choice = f"{', '.join(endings[:-1])} or {endings[-1]}"
                raise typer.BadParameter(f"{path}: the name must end in {choice}")
        return paths

    return check


@contextmanager
def usage() -> Iterator[None]:
    """Turn a `RoadevalError` inside the block into an error of usage."""
    try:
        yield
    except RoadevalError as error:
        raise typer.BadParameter(with_flags(error.sentence)) from error


def _check_conditions(texts: list[str] | None) -> list[str] | None:
    from roadeval.evaluation.comparison.conditions import Condition

    with usage():
        for text in texts or ():
            Condition.parse(text)
    return texts


Conditions = Annotated[
    list[str] | None,
    option(
        "--fail-if",
        "Condition for exit code 4: a change, as 'post.filtered.ERR > +0.5pp' (with 'surely' at "
        "the end: its whole interval), or a level, as '> 20%'. Repeatable.",
        "CONDITION",
        callback=_check_conditions,
    ),
]


def configuration(options: OptionValues) -> RunConfig:
    """Return the configuration of a preset, a file on top of it, and options on top of both.

    A `typer.BadParameter` if a value is wrong whatever the files hold, or options do not go
    together; a `RoadevalError` if a file cannot be used.
    """
    from roadeval.config.camera_file import read_camera
    from roadeval.config.run import configure
    from roadeval.config.tables import ConfigError, in_file, read_tables
    from roadeval.config.variants import network_variant

    preset = {"preset": options["preset"]} if "preset" in options else {}
    with usage():
        _check_names(options)
        config = configure(preset)
    if path := options.get("config"):
        tables = read_tables(path)
        if preset and tables.get("preset", options["preset"]) != options["preset"]:
            problem = f"starts from preset {tables['preset']}, not from {options['preset']}"
            raise ConfigError(problem, where=path)
        config = configure({**preset, **tables}, where=str(path))
    variants = [_variant(name, path) for name, path in options.get("variants", ())]
    variants += [network_variant(name, path) for name, path in options.get("nets", ())]
    masks = {name: _mask_tables(name, path) for name, path in options.get("masks", ())}
    with usage():
        config = config.override({**_tables(options), "masks": masks}).with_variants(variants)
        config = config.with_tuned(options.get("tunes", ()))
        if "only" in options:
            config = config.override({"only": options["only"]})
    # By default computed variants come before masks of other methods; here the first typed one is.
    methods, names = ("variants", "nets", "topics.masks", "masks"), config.brought()
    typed_names = [name for o in options if o in methods for name, _ in options[o] if name in names]
    if not config.output.focus and names and names[0] in typed_names[1:]:
        config = config.override({"output": {"focus": typed_names[0]}})
    if path := options.get("ground"):
        ground = read_camera(path, config.topics.image)
        with in_file(str(path)):
            config = config.override({"ground": ground})
    frame_options = {"training.frames", "training.placement", "training.gap"}
    if config.training.model and not config.training.adapt and frame_options & options.keys():
        raise typer.BadParameter(
            "--train-frames, --train-on and --train-gap do not go with a model "
            f"({config.training.model})"
        )
    return config


def _variant(name: str, path: str | None) -> Variant:
    """Return a variant by a file or preset; without ``path`` the preset ``name`` defines it."""
    from roadeval.config.tables import read_tables
    from roadeval.config.variants import PRESETS, Variant

    preset = name if path is None else path
    if path is not None and preset not in PRESETS and (Path(path).suffix or Path(path).exists()):
        return Variant.of(name, read_tables(path), path)
    with usage():
        return Variant.of(name, {"preset": preset}, f"{FLAGS['variants']} {name} names no file")


def _mask_tables(name: str, path: str) -> dict[str, Any]:
    """Return the settings of masks in a folder or a log, or the settings in a TOML file."""
    from roadeval.config.tables import in_file, read_tables
    from roadeval.config.variants import with_masks

    if not path.endswith(".toml"):
        return {"path": path}
    tables = read_tables(path)
    with in_file(path):
        with_masks({}, {name: tables})
    return tables


Camera = Annotated[str | None, option("--camera", "Name of one of several cameras.", "NAME")]
Focus = Annotated[
    str | None,
    option("--focus", "Variant to report on. Default: what you brought, else filtered.", "NAME"),
]


def select_camera(result: Result_, name: str | None) -> Result_:
    """Return the result of a rig's camera, by its name or the part by which the names differ.

    Return the result itself if ``name`` is None. A `typer.BadParameter` if it has no such camera.
    """
    if name is None:
        return result
    from roadeval.data.words import short_names

    by_short_name = {short: camera for camera, short in short_names([*result.cameras]).items()}
    camera = by_short_name.get(name, name)
    if camera not in result.cameras:
        choice = f"the result has {', '.join(by_short_name)}" if by_short_name else "leave it out"
        raise typer.BadParameter(f"--camera {name}: there is no such camera; {choice}")
    return result.cameras[camera]


def check_one_camera(options: OptionValues) -> None:
    """Raise a `typer.BadParameter` for several cameras."""
    if len(options.get("cameras", ())) > 1:
        raise typer.BadParameter("--image-topic: this command takes one camera at a time")


def _check_names(options: OptionValues) -> None:
    """Raise a `RoadevalError` if two variants or labels have one name, or a name cannot be used."""
    from roadeval.config.variants import check_variant_name
    from roadeval.data import FILTERED, UNFILTERED

    taken = [FILTERED, UNFILTERED]
    for option in ("variants", "nets", "topics.masks", "masks"):
        for name, _ in options.get(option, ()):
            check_variant_name(name, taken)
            taken.append(name)
    labels = [name for name, _ in options.get("output.labels", ())]
    if len({*labels}) < len(labels):
        raise RoadevalError("two labels have the same name", setting="output.labels")


def _tables(options: OptionValues) -> dict[str, Any]:
    """Return the values of options as the tables of a TOML file."""
    tables: dict[str, Any] = {}
    for setting, value in options.items():
        table, _, key = setting.partition(".")
        if key:
            tables.setdefault(table, {})[key] = dict(value) if key in ("masks", "labels") else value
    topics = options.get("cameras", ())
    if len(topics) > 1:
        tables["cameras"] = [{"image": topic} for topic in topics]
    elif topics:
        tables["cameras"] = []
        tables["topics"] = {**tables.get("topics", {}), "image": topics[0]}
    return tables
