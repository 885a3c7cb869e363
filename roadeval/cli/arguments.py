"""From the words of a command line to the configuration of a run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roadeval.cli.options import FLAGS, Given, with_flags
from roadeval.errors import RoadevalError

if TYPE_CHECKING:
    from roadeval.config.run import RunConfig
    from roadeval.config.variants import Variant
    from roadeval.jobs.results.result import Result as Result_


def option(flags: str, text: str, metavar: str | None = None, **more: Any) -> Any:
    """Return an option with its help; whoever opens a file says what is wrong with it."""
    return typer.Option(*flags.split(), help=text, metavar=metavar, readable=False, **more)


def argument(metavar: str, text: str) -> Any:
    """Return an argument with its help."""
    return typer.Argument(metavar=metavar, help=text, show_default=False, readable=False)


Drive = Annotated[str, argument("DRIVE", "A camera log (MCAP), or its URL.")]
Result = Annotated[Path, argument("RESULT", "A recording (.rrd), or a results folder.")]
Json = Annotated[bool, option("--json", "Print the result on stdout as JSON.")]
Quiet = Annotated[bool, option("-q --quiet", "No progress and no table; warnings stay.")]


@contextmanager
def usage() -> Iterator[None]:
    """Turn a known problem inside the block into wrong usage."""
    try:
        yield
    except RoadevalError as error:
        raise typer.BadParameter(with_flags(error.sentence)) from error


def _condition(texts: list[str] | None) -> list[str] | None:
    from roadeval.evaluation.comparison.conditions import Condition

    with usage():
        for text in texts or ():
            Condition.parse(text)
    return texts


Conditions = Annotated[
    list[str] | None,
    option(
        "--fail-if",
        "As 'post.filtered.ERR > +0.5pp' (change; with 'surely' at the end: its whole interval) or "
        "'> 20%' (level). Repeatable.",
        "CONDITION",
        callback=_condition,
    ),
]


def configuration(given: Given) -> RunConfig:
    """Return the configuration of a preset, a file, and options on top of both.

    A `typer.BadParameter` for a value that can be seen to be wrong without opening a file, or
    options that do not go together; a `RoadevalError` for a file that cannot be used.
    """
    from roadeval.config.camera_file import read_camera
    from roadeval.config.run import configure
    from roadeval.config.tables import ConfigError, in_file, read_tables
    from roadeval.config.variants import network_variant

    preset = {"preset": given["preset"]} if "preset" in given else {}
    with usage():
        _check_names(given, "variants", "nets", "topics.masks", "masks")
        config = configure(preset)
    if path := given.get("config"):
        tables = read_tables(path)
        if preset and tables.get("preset", given["preset"]) != given["preset"]:
            raise ConfigError(
                f"{path}: starts from preset {tables['preset']}, not from {given['preset']}"
            )
        config = configure({**preset, **tables}, where=str(path))
    variants = [_variant(*each) for each in given.get("variants", ())]
    variants += [network_variant(*each) for each in given.get("nets", ())]
    masks = {name: _masks(name, path) for name, path in given.get("masks", ())}
    with usage():
        config = config.override(
            {**_tables(given), **_cameras(given), "masks": masks}
        ).with_variants(variants)
        config = config.with_tuned(given.get("tunes", ()))
        if "only" in given:
            config = config.override({"only": given["only"]})
    if path := given.get("ground"):
        ground = read_camera(path, config.topics.image)
        with in_file(str(path)):
            config = config.override({"ground": ground})
    chosen = {"training.frames", "training.placement", "training.gap"}
    if config.training.model and not config.training.adapt and chosen & given.keys():
        raise typer.BadParameter(
            "--train-frames, --train-on and --train-gap do not go with a model "
            f"({config.training.model})"
        )
    return config


def _variant(name: str, path: str | None) -> Variant:
    """Return the variant of a file or of a preset; with neither, of the preset of its name."""
    from roadeval.config.tables import read_tables
    from roadeval.config.variants import PRESETS, Variant

    preset = name if path is None else path
    if path is not None and preset not in PRESETS and (Path(path).suffix or Path(path).exists()):
        return Variant.of(name, read_tables(path), path)
    with usage():
        return Variant.of(name, {"preset": preset}, f"{FLAGS['variants']} {name} names no file")


def _masks(name: str, path: str) -> dict[str, Any]:
    """Return the table of masks of a folder or log, or of a file that describes them."""
    from roadeval.config.tables import in_file, read_tables
    from roadeval.config.variants import with_masks

    if not path.endswith(".toml"):
        return {"path": path}
    tables = read_tables(path)
    with in_file(path):
        with_masks({}, {name: tables})
    return tables


def _cameras(given: Given) -> dict[str, Any]:
    """Return the topics of images as settings: of one camera, or of several."""
    topics = given.get("cameras", ())
    if len(topics) > 1:
        return {"cameras": [{"image": topic} for topic in topics]}
    own = _tables(given).get("topics", {})
    return {"cameras": [], "topics": {**own, "image": topics[0]}} if topics else {}


Camera = Annotated[str | None, option("--camera", "Of several cameras: this one alone.", "NAME")]


def of_camera(result: Result_, name: str | None) -> Result_:
    """Return the result of a camera of a rig, by its name or the part of it that differs.

    The result itself where no camera is named. Wrong usage if there is none of that name.
    """
    if name is None:
        return result
    from roadeval.data.words import short_names

    short = {own: camera for camera, own in short_names([*result.cameras]).items()}
    camera = short.get(name, name)
    if camera not in result.cameras:
        known = ", ".join(short) or "only one"
        raise typer.BadParameter(f"--camera {name}: the result has {known}")
    return result.cameras[camera]


def one_camera(given: Given) -> None:
    """Refuse, as wrong usage, several cameras where a command looks at one."""
    if len(given.get("cameras", ())) > 1:
        raise typer.BadParameter("--image-topic: this command takes one camera at a time")


def _check_names(given: Given, *options: str) -> None:
    from roadeval.config.variants import check_variant_name
    from roadeval.data import FILTERED, UNFILTERED

    taken = [FILTERED, UNFILTERED]
    for name, _ in (each for option in options for each in given.get(option, ())):
        check_variant_name(name, taken)
        taken.append(name)


def _tables(given: Given) -> dict[str, dict[str, Any]]:
    """Arrange the values of ``table.key`` settings as a TOML file has them."""
    tables: dict[str, dict[str, Any]] = {}
    for setting, value in given.items():
        table, _, key = setting.partition(".")
        if key:
            tables.setdefault(table, {})[key] = dict(value) if key == "masks" else value
    return tables
