"""The options that give settings of a run's configuration their values.

An option is made of a setting's field: its flag, its type and its meaning stand there. Only what is
no single setting is declared here. No other module knows a flag: errors name settings, and
`with_flags` replaces these names.
"""

from __future__ import annotations

import builtins
import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Final, Union, get_args, get_origin, get_type_hints

import typer

from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
from roadeval.logs.settings import FrameSettings, LabelSettings, TopicSettings
from roadeval.runtime.settings import Flag, meanings
from roadeval.training.settings import TrainingSettings

GROUPS: Final = {
    "output": "Output",
    "methods": "Methods",
    "training": "Training",
    "topics": "Truth",
    "labels": "Truth",
    "frames": "Range",
    "input": "Input",
    "run": "Execution",
    "fleet": "Fleet",
}
"""The parts of the help, in their order, by the tables whose settings stand there."""
SETTINGS: Final = {
    "output": OutputSettings,
    "training": TrainingSettings,
    "topics": TopicSettings,
    "labels": LabelSettings,
    "frames": FrameSettings,
    "run": ExecutionSettings,
    "fleet": FleetSettings,
}
"""The settings that flags set, by the names of their tables."""

Given = Mapping[str, Any]
"""Values of options by the names of their settings; one that was not typed is not there."""


@dataclasses.dataclass(frozen=True, slots=True)
class Option:
    """An option of the command line that gives a setting its value."""

    setting: str
    """``table.key`` in a run's configuration; the others are read by `roadeval.cli.arguments`."""
    flags: tuple[str, ...]
    """As they are typed; the last one is named in messages."""
    metavar: str | None
    """Stands for the value in the help; none for a switch."""
    help: str
    kind: Any = str
    """The type of what is typed; a list for an option that can be repeated."""
    read: Callable[[str], Any] | None = None
    """Turns a word of such a list into a value."""
    group: str = "Methods"
    """Its part of the help."""

    @classmethod
    def of(cls, table: str, key: str, hint: Any, default: Any, meaning: str) -> Option | None:
        """Return the option of a setting that has a flag, by the type of its field."""
        flag = next((each for each in get_args(hint)[1:] if isinstance(each, Flag)), None)
        if flag is None:
            return None
        sentences = re.split(r"(?<=[.:]) (?=[A-Z])", " ".join(meaning.replace("``", "").split()))
        told = [sentences[0], *(each for each in sentences[1:] if each.startswith("Default"))]
        kind, read = _kind(hint)
        if get_origin(kind) is list:
            told.append("Repeatable.")
        elif default and kind is not bool:
            told.append(f"Default: {default}.")
        group = flag.group or GROUPS[table]
        names = tuple(flag.names.split())
        return cls(f"{table}.{key}", names, flag.metavar or None, " ".join(told), kind, read, group)

    @property
    def argument(self) -> str:
        """The name of the Python argument that receives the value."""
        return self.setting.replace(".", "_")

    def parameter(self) -> inspect.Parameter:
        """Return the parameter that Typer makes the option of."""
        # Whoever opens a file tells whether it can be read, as of any other problem with it.
        option = typer.Option(
            *self.flags,
            metavar=self.metavar,
            show_default=False,
            help=self.help,
            readable=False,
            rich_help_panel=self.group,
        )
        return inspect.Parameter(
            self.argument,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[self.kind | None, option],
        )

    def value(self, typed: Any) -> Any:
        """Read what was typed; None where nothing was."""
        if self.read is None:
            return None if typed == [] else typed
        return [self.read(word) for word in typed] if typed else None


def _kind(hint: Any) -> tuple[Any, Callable[[str], Any] | None]:
    """Return what is typed for a value of a type, and how its words are read."""
    kind = _bare(hint)
    match get_origin(kind):
        case None:
            return kind, None
        case typing.Literal:
            return str, None
        case builtins.tuple:
            return (list[int], None) if _bare(get_args(kind)[0]) is int else (list[str], color)
        case _:
            return list[str], named


def _bare(hint: Any) -> Any:
    """Return a type without its metadata, and without None."""
    while get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, types.UnionType):
        return _bare(next(each for each in get_args(hint) if each is not types.NoneType))
    return hint


def color(text: str) -> tuple[int, ...]:
    """Read ``R,G,B``, 0..255 each."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"{text!r} is not R,G,B (as 128,64,128)")
    return tuple(int(part) for part in parts)


def named(text: str) -> tuple[str, str]:
    """Read ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    if not name or not value:
        raise typer.BadParameter(f"{text!r} is not NAME=...")
    return name, value


def _variant(text: str) -> tuple[str, str | None]:
    """Read ``NAME=FILE.toml`` or ``NAME=PRESET``, or the name of a preset alone."""
    return named(text) if "=" in text else (text, None)


METHODS: Final = (
    Option(
        "preset",
        ("--preset",),
        "paper|printed|printed_order|hsi|gated|robust",
        "The equations as meant (the default); the misprints taken literally; the paper with its "
        "own order of post-processing, or with shadow compensated in HSI; a more careful shadow "
        "filter; or for use on a road.",
    ),
    Option(
        "config",
        ("--config",),
        "FILE.toml",
        "Settings on top of the preset: all that 'roadeval config' prints, the run.toml of an "
        "earlier run, or its recording.",
        Path,
    ),
    Option(
        "variants",
        ("--variant",),
        "NAME=FILE.toml|NAME=PRESET|PRESET",
        "One more variant beside filtered and unfiltered: of a file, or a preset by its name. "
        "Repeatable.",
        list[str],
        _variant,
    ),
    Option(
        "nets",
        ("--net",),
        "NAME=FILE",
        "One more variant: the network of an ONNX file, or of a TOML file with its settings, as "
        "the size of its input. Repeatable.",
        list[str],
        named,
    ),
    Option(
        "masks",
        ("--masks",),
        "NAME=FOLDER|LOG:TOPIC|FILE.toml",
        "Score masks that lie in a folder, or in another log, as one more variant; of a file with "
        "a path and more, as a threshold of confidences. Repeatable.",
        list[str],
        named,
    ),
    Option(
        "drives",
        ("--drive",),
        "DRIVE=FILE.toml",
        "A file with the [topics], [labels] or [frames] of one drive, by its path or its file's "
        "name, or of several, as 'monday*.mcap'. Repeatable.",
        list[str],
        named,
        "Input",
    ),
)
"""The options that are more than one setting."""


def _of_settings() -> Iterator[Option]:
    for table, kind in SETTINGS.items():
        hints, texts = get_type_hints(kind, include_extras=True), meanings(kind)
        for field in dataclasses.fields(kind):
            default = None if field.default is dataclasses.MISSING else field.default
            option = Option.of(table, field.name, hints[field.name], default, texts[field.name])
            if option is not None:
                yield option


OPTIONS: Final = tuple(
    sorted((*METHODS, *_of_settings()), key=lambda option: [*GROUPS.values()].index(option.group))
)
"""In the order of the help."""

FLAGS: Final[Mapping[str, str]] = {option.setting: option.flags[-1] for option in OPTIONS} | {
    "trust_sources": "--trust-sources"
}
_MARKED: Final = re.compile(r"`(\w+(?:\.\w+)?)`")


def with_flags(text: str) -> str:
    """Replace the settings in a message, between backticks, by the flags that give them values.

    Examples
    --------
    >>> with_flags("nothing is left to evaluate; lower `training.frames`")
    'nothing is left to evaluate; lower --train-frames'
    """
    return _MARKED.sub(lambda found: FLAGS.get(found[1], found[0]), text)


def takes(*settings: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Make a command take the options of some settings, which it receives as ``given``.

    Parameters
    ----------
    settings
        Names of settings in `OPTIONS`, or of whole tables.

    Raises
    ------
    ValueError
        For a name that is none of them.
    """
    known = {name for o in OPTIONS for name in (o.setting, o.setting.partition(".")[0])}
    if unknown := {*settings} - known:
        raise ValueError(f"no option sets {', '.join(sorted(unknown))}")
    chosen = [o for o in OPTIONS if {o.setting, o.setting.partition(".")[0]} & {*settings}]

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        @wraps(command)
        def run(*args: Any, **values: Any) -> int:
            given = {o.setting: o.value(values.pop(o.argument, None)) for o in chosen}
            typed = {name: value for name, value in given.items() if value is not None}
            return command(*args, given=typed, **values)

        signature = _with_options(inspect.signature(command, eval_str=True), chosen)
        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in signature.parameters.values()}
        return run

    return decorate


def _with_options(signature: inspect.Signature, options: Iterable[Option]) -> inspect.Signature:
    """Put options in place of ``given``: after the arguments, before a command's own options."""
    own = [each for each in signature.parameters.values() if each.name != "given"]
    arguments = [each for each in own if each.kind is not each.KEYWORD_ONLY]
    others = [each for each in own if each.kind is each.KEYWORD_ONLY]
    parameters = [*arguments, *(option.parameter() for option in options), *others]
    return signature.replace(parameters=parameters)
