"""The options that give the settings of a run their values.

An option is made of a setting's field: its flag, its type and its meaning stand there. No other
module knows a flag: sentences name settings, and `with_flags` names their flags.
"""

from __future__ import annotations

import builtins
import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from typing import Annotated, Any, Final, Union, get_args, get_origin, get_type_hints

import typer

from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
from roadeval.logs.settings import FrameSettings, LabelPlace, LabelSettings, TopicSettings
from roadeval.runtime.sentence import name_settings
from roadeval.runtime.settings import Flag, meanings
from roadeval.training.settings import TrainingSettings

Given = Mapping[str, Any]
"""Values of options by the names of their settings, without those that were not typed."""


@dataclass(frozen=True)
class MethodSettings:
    """Options that are more than one setting of a run; `roadeval.cli.arguments` reads them."""

    preset: Annotated[
        str | None, Flag("--preset", "paper|printed|printed_order|hsi|gated|robust")
    ] = None
    """The equations as meant (the default); the misprints taken literally; the paper with its own
    order of post-processing, or with shadow compensated in HSI; a more careful shadow filter; or
    for use on a road."""
    config: Annotated[Path | None, Flag("--config", "FILE.toml")] = None
    """Settings on top of the preset: all that 'roadeval config' prints, the run.toml of an earlier
    run, or its recording."""
    variants: Annotated[
        Mapping[str, str | None], Flag("--variant", "NAME=FILE.toml|NAME=PRESET|PRESET")
    ] = dataclasses.field(default_factory=dict)
    """One more variant beside filtered and unfiltered: of a file, or a preset by its name."""
    nets: Annotated[Mapping[str, str], Flag("--net", "NAME=FILE")] = dataclasses.field(
        default_factory=dict
    )
    """One more variant: the network of an ONNX file, or of a TOML file with its settings, as the
    size of its input."""
    masks: Annotated[Mapping[str, str], Flag("--masks", "NAME=FOLDER|LOG:TOPIC|FILE.toml")] = (
        dataclasses.field(default_factory=dict)
    )
    """Score the masks of a folder, or of another log, as one more variant; a file holds their path
    and more, as a threshold of confidences."""
    tunes: Annotated[tuple[str, ...], Flag("--tune", "NAME")] = ()
    """One more variant, NAME_tuned: what a network, masks, or a method of your own would be with
    this drive's first labelled frames to learn from. Trees that see what it says of each pixel,
    and all that the preset robust sees, learn where it errs."""
    only: Annotated[tuple[str, ...], Flag("--only", "NAME")] = ()
    """Run these variants alone, masks included. Where none of them learns anything, no frame is
    taken for training."""
    cameras: Annotated[tuple[str, ...], Flag("--image-topic", "T", "Input")] = ()
    """The camera's topic, where the log has several. Given again, each camera is replayed, scored
    apart, and recorded beside the others."""
    ground: Annotated[Path | None, Flag("--camera", "FILE", "Input")] = None
    """Where the camera is over the ground, as its height and pitch, where the log does not say so:
    with it errors are counted in metres, too. A TOML file, or the YAML of ROS's camera_calibration
    or of Kalibr."""


GROUPS: Final = ("Output", "Methods", "Training", "Truth", "Range", "Input", "Execution", "Fleet")
"""The parts of the help, in their order."""
TABLES: Final[Mapping[str, tuple[type, str]]] = {
    "": (MethodSettings, "Methods"),
    "output": (OutputSettings, "Output"),
    "training": (TrainingSettings, "Training"),
    "truth": (LabelPlace, "Truth"),
    "topics": (TopicSettings, "Truth"),
    "labels": (LabelSettings, "Truth"),
    "frames": (FrameSettings, "Range"),
    "run": (ExecutionSettings, "Execution"),
    "fleet": (FleetSettings, "Fleet"),
}
"""The settings that flags set, by the names of their tables, and their parts of the help."""


@dataclass(frozen=True)
class Option:
    """An option of the command line that gives a setting its value."""

    setting: str
    """``table.key`` in a run's configuration, or a field of `MethodSettings`."""
    flags: tuple[str, ...]
    """The last one is named in messages."""
    metavar: str | None
    """The placeholder of the value in the help; none for a switch."""
    help: str
    kind: Any
    """The type of what is typed; a list for an option that can be repeated."""
    read: Callable[[str], Any] | None
    """Turns a word of such a list into a value."""
    group: str
    """Its part of the help."""

    @property
    def argument(self) -> str:
        """The name of the Python argument that receives the value."""
        return self.setting.replace(".", "_")

    def parameter(self) -> inspect.Parameter:
        """Return the parameter that Typer makes the option of."""
        option = typer.Option(
            *self.flags,
            metavar=self.metavar,
            show_default=False,
            help=self.help,
            readable=False,  # whoever opens a file says what is wrong with it
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


def _options() -> Iterator[Option]:
    for table, (settings, group) in TABLES.items():
        hints, texts = get_type_hints(settings, include_extras=True), meanings(settings)
        for field in dataclasses.fields(settings):
            hint = hints[field.name]
            flag = next((each for each in get_args(hint)[1:] if isinstance(each, Flag)), None)
            if flag is not None:
                flags = tuple(flag.names.split())
                kind, read = _kind(hint, f"{flags[-1]} {flag.metavar.partition('=')[0]}")
                yield Option(
                    f"{table}.{field.name}".removeprefix("."),
                    flags,
                    flag.metavar or None,
                    _help(texts[field.name], kind, field.default),
                    kind,
                    read,
                    flag.group or group,
                )


def _help(meaning: str, kind: Any, default: Any) -> str:
    """Return the first sentence of a setting's meaning, and what its default is."""
    sentences = re.split(r"(?<=[.:]) (?=[A-Z])", " ".join(meaning.replace("``", "").split()))
    shown = [sentences[0], *(each for each in sentences[1:] if each.startswith("Default"))]
    if get_origin(kind) is list:
        shown.append("Repeatable.")
    elif default and default is not dataclasses.MISSING and kind is not bool:
        shown.append(f"Default: {default}.")
    return " ".join(shown)


def _kind(hint: Any, names: str) -> tuple[Any, Callable[[str], Any] | None]:
    """Return what is typed for a value of a type, and how its words are read.

    ``names`` is the flag and the placeholder of its value's name, as ``--net NAME``.
    """
    kind = _bare(hint)
    match get_origin(kind):
        case None:
            return kind, None
        case typing.Literal:
            return str, None
        case builtins.tuple:
            readers: Mapping[type, Callable[[str], Any]] = {str: str, int: value_or_name}
            return list[str], readers.get(_bare(get_args(kind)[0]), color)
        case _:
            return list[str], partial(named if get_args(kind)[1] is str else _maybe_named, names)


def _bare(hint: Any) -> Any:
    """Return a type without its metadata, and without None."""
    while get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, types.UnionType):
        return _bare(next(each for each in get_args(hint) if each is not types.NoneType))
    return hint


def value_or_name(text: str) -> int | str:
    """Read a label's value, or the name of its class."""
    return int(text) if re.fullmatch(r"-?[0-9]{1,18}", text) else text


def color(text: str) -> tuple[int, ...]:
    """Read ``R,G,B``, 0..255 each."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"{text!r} is not R,G,B (as 128,64,128)")
    return tuple(int(part) for part in parts)


def named(names: str, text: str) -> tuple[str, str]:
    """Read ``NAME=VALUE``; ``names`` is that of `_kind`."""
    *name, value = text.split("=", 1)
    if not value:
        raise typer.BadParameter(f"{text!r} has nothing after '='")
    if not any(name):
        flag = names.partition(" ")[0]
        raise typer.BadParameter(f"{text!r}: write {names}={value}, as {flag} mine={value}")
    return name[0], value


def _maybe_named(names: str, text: str) -> tuple[str, str | None]:
    is_path = "=" in text or Path(text).suffix or Path(text).name != text
    return named(names, text) if is_path else (text, None)


OPTIONS: Final = tuple(sorted(_options(), key=lambda option: GROUPS.index(option.group)))
"""In the order of the help."""
FLAGS: Final[Mapping[str, str]] = {option.setting: option.flags[-1] for option in OPTIONS} | {
    "topics.image": "--image-topic"
}


def with_flags(text: str) -> str:
    """Return a sentence with its settings named by the flags that give them values.

    >>> from roadeval.runtime.sentence import Sentence
    >>> with_flags(Sentence("nothing is left to evaluate; lower {training.frames}"))
    'nothing is left to evaluate; lower --train-frames'
    >>> with_flags(Sentence("set {masks.net.first} to 1"))
    'set `first` in the file of --masks net=FILE.toml to 1'
    """
    return str(name_settings(text, _flag_of))


def _flag_of(setting: str) -> str:
    table, _, rest = setting.partition(".")
    name, _, key = rest.partition(".")
    if table == "masks" and key:
        return f"`{key}` in the file of {FLAGS[table]} {name}=FILE.toml"
    if setting.startswith("topics.masks."):
        return f"{FLAGS['topics.masks']} {key}"
    return FLAGS.get(setting, f"`{setting}`")


def takes(*settings: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Make a command take the options of some settings, which it receives as ``given``.

    The settings are those of `OPTIONS`, or whole tables; for any other name a ValueError.
    """
    named_by = {option: {option.setting, option.setting.partition(".")[0]} for option in OPTIONS}
    if unknown := {*settings}.difference(*named_by.values()):
        raise ValueError(f"no option sets {', '.join(sorted(unknown))}")
    chosen = [option for option, names in named_by.items() if names & {*settings}]

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
