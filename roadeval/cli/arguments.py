"""From the words of a command line to the configuration of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roadeval.cli.options import FLAGS, Given, with_flags
from roadeval.errors import RoadevalError

if TYPE_CHECKING:
    from roadeval.config import DriveSettings, RunConfig, Variant
    from roadeval.logs import LogConfig
    from roadeval.report.pdf.typeset import Paper

Drive = Annotated[
    Path,
    typer.Argument(
        metavar="DRIVE", show_default=False, help="A camera log (MCAP).", readable=False
    ),
]
Result = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT",
        show_default=False,
        help="A recording (.rrd), or a results folder.",
        readable=False,
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result on stdout as JSON.")]
Quiet = Annotated[
    bool, typer.Option("-q", "--quiet", help="No progress and no table; warnings stay.")
]

TrustSources = Annotated[
    bool,
    typer.Option(
        "--trust-sources",
        help="Of a fleet: read logs, masks, networks and recordings wherever its folder says that "
        "they lie, files and URLs alike. Without it nothing outside the folder is read.",
    ),
]
PaperSize = Annotated[
    str, typer.Option("--paper", metavar="a4|letter", show_default=False, help="Default: a4.")
]


def paper_of(size: str) -> Paper:
    """Return the size of paper; one that is not known is wrong usage."""
    from roadeval.report.pdf.typeset import Paper

    if size not in [*Paper]:
        raise typer.BadParameter(f"{size!r} is none of {', '.join(Paper)}")
    return Paper(size)


@contextmanager
def usage() -> Iterator[None]:
    """Turn a known problem inside the block into wrong usage."""
    try:
        yield
    except RoadevalError as error:
        raise typer.BadParameter(with_flags(str(error))) from error


def _condition(texts: list[str] | None) -> list[str] | None:
    from roadeval.evaluation.comparison import Condition

    with usage():
        for text in texts or ():
            Condition.parse(text)
    return texts


Conditions = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="CONDITION",
        callback=_condition,
        help="As 'post.filtered.ERR > +0.5pp' (change; with 'surely' at the end: its whole "
        "interval) or '> 20%' (level). Repeatable.",
    ),
]


def configuration(given: Given) -> RunConfig:
    """Return the configuration of a preset, a file, and options on top of both.

    What can be seen to be wrong without opening a file is wrong usage.

    Raises
    ------
    typer.BadParameter
        For an option's value that cannot be used, or options that do not go together.
    RoadevalError
        For a file that cannot be used.
    """
    from roadeval.config import configure

    options = ("variants", "nets", "topics.masks", "masks")
    named = [each for option in options for each in given.get(option, ())]
    with usage():
        _check_names([name for name, _ in named])
        base = configure(_preset(given)) if "config" not in given else None
    config = _from_file(given) if base is None else base
    variants = [_variant(*each) for each in given.get("variants", ())]
    variants += [_network(*each) for each in given.get("nets", ())]
    masks = {"masks": dict(_masks(*each) for each in given.get("masks", ()))}
    with usage():
        whole = config.override(_tables(given) | masks).with_variants(variants)
    whole = whole.with_drives(_drive(*each) for each in given.get("drives", ()))
    chosen = {"training.frames", "training.placement", "training.gap"}
    if whole.training.model and not whole.training.adapt and chosen & given.keys():
        raise typer.BadParameter(
            "--train-frames, --train-on and --train-gap do not go with a model "
            f"({whole.training.model})"
        )
    return whole


def of_a_log(given: Given) -> LogConfig:
    """Return what options ask of a log; wrong usage as in `configuration`."""
    from roadeval.config import log_config

    with usage():
        _check_names([name for name, _ in given.get("topics.masks", ())])
        return log_config(_tables(given))


def _preset(given: Given) -> dict[str, str]:
    return {"preset": given["preset"]} if "preset" in given else {}


def _from_file(given: Given) -> RunConfig:
    from roadeval.config import ConfigError, configure, read_tables

    path = given["config"]
    tables = read_tables(path)
    preset = given.get("preset")
    if preset is not None and tables.get("preset", preset) != preset:
        raise ConfigError(f"{path}: starts from preset {tables['preset']}, not from {preset}")
    return configure({**_preset(given), **tables}, where=str(path))


def _variant(name: str, path: str | None) -> Variant:
    """Return the variant of a file or of a preset; with neither, of the preset of its name."""
    from roadeval.config import PRESETS, Variant, read_tables

    preset = name if path is None else path
    if path is not None and preset not in PRESETS and (Path(path).suffix or Path(path).exists()):
        return Variant.of(name, read_tables(path), path)
    with usage():
        return Variant.of(name, {"preset": preset}, f"{FLAGS['variants']} {name} names no file")


def _network(name: str, path: str) -> Variant:
    from roadeval.config import network_variant

    return network_variant(name, path)


def _masks(name: str, path: str) -> tuple[str, dict[str, Any]]:
    """Return the table of masks that lie under a path, or that a file describes."""
    from roadeval.config import read_tables, with_masks

    if not path.endswith(".toml"):
        return name, {"path": path}
    tables = read_tables(path)
    with_masks({}, {name: tables}, path)
    return name, tables


def _drive(path: str, file: str) -> DriveSettings:
    from roadeval.config import DriveSettings, read_tables

    return DriveSettings.of({**read_tables(file), "path": path}, file)


def _check_names(names: Sequence[str]) -> None:
    from roadeval.config import check_variant_name
    from roadeval.data import FILTERED, UNFILTERED

    for place, name in enumerate(names):
        check_variant_name(name, [FILTERED, UNFILTERED, *names[:place]])


def _tables(given: Given) -> dict[str, dict[str, Any]]:
    """Arrange the values of ``table.key`` settings as a TOML file has them."""
    tables: dict[str, dict[str, Any]] = {}
    for setting, value in given.items():
        table, _, key = setting.partition(".")
        if key:
            tables.setdefault(table, {})[key] = dict(value) if key == "masks" else value
    return tables
