"""The options of the command line, which give the settings of a run their values.

An option is made from the field of a setting, which states its flag, its type and its meaning.
Sentences name settings; `with_flags` names their flags instead.
"""

from __future__ import annotations

import builtins
import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterator, Mapping
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

OptionValues = Mapping[str, Any]
"""The values of the options that were typed, by the names of their settings."""


@dataclass(frozen=True)
class MethodSettings:
    """Options that stand for more than one setting; `roadeval.cli.arguments` reads them.

    preset: Preset to start from; paper: equations as meant (the default); printed: their misprints
        taken literally; printed_order: the paper's post-processing order; hsi: shadow compensated
        in HSI; gated: a more careful shadow filter; robust: best on real roads.
    config: File of settings on top of the preset: an edited output of 'roadeval config', the
        run.toml of an earlier run, or the recording of that run.
    variants: Further variant: a preset, as robust, or a file of settings.
    nets: Network as a further variant: an ONNX file, a Hugging Face folder, or a TOML file.
    masks: Masks as a further variant: a folder, LOG.mcap:/topic, or a TOML file.
    tunes: Method, such as a network, that a further variant NAME_tuned corrects: it learns from
        this drive's first labelled frames where the method errs. Its trees use the method's output
        and all features of the preset robust.
    only: Variant to run, masks included; the others are left out. If none of them learns anything,
        no frame is used for training.
    cameras: Topic of the camera, if the log has several. If several topics are given, each camera
        is replayed and scored by itself, and recorded beside the others.
    ground: File of the camera's height, angles and lens, if the log lacks them: with these, errors
        are counted in metres, too. A TOML file, or the YAML of ROS's camera_calibration or of
        Kalibr.
    """

    preset: Annotated[
        str | None, Flag("--preset", "paper|printed|printed_order|hsi|gated|robust")
    ] = None
    config: Annotated[Path | None, Flag("--config", "FILE.toml")] = None
    variants: Annotated[Mapping[str, str | None] | None, Flag("--variant", "NAME=FILE|PRESET")] = (
        None
    )
    nets: Annotated[Mapping[str, str] | None, Flag("--net", "NAME=FILE")] = None
    masks: Annotated[Mapping[str, str] | None, Flag("--masks", "NAME=PATH")] = None
    tunes: Annotated[tuple[str, ...], Flag("--tune", "NAME")] = ()
    only: Annotated[tuple[str, ...], Flag("--only", "NAME")] = ()
    cameras: Annotated[tuple[str, ...], Flag("--image-topic", "T", "Input")] = ()
    ground: Annotated[Path | None, Flag("--camera", "FILE", "Input")] = None


MOST_USED: Final = "Most used"
FIRST: Final = ("truth.path", "labels.road", "nets", "masks", "variants", "output.reports")
"""Settings with the flags that most people need, in their order in the help."""
GROUPS: Final = (
    *(MOST_USED, "Output", "Methods", "Training", "Truth", "Range"),
    *("Input", "Execution", "Fleet"),
)
"""The groups of the help, in their order."""
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
"""The settings that flags set, by the names of their tables, and their groups of the help."""


@dataclass(frozen=True)
class Option:
    """An option of the command line that gives a setting its value."""

    setting: str
    """``table.key`` in a run's configuration, or a field of `MethodSettings`."""
    flags: tuple[str, ...]
    """Its spellings; messages use the last one."""
    metavar: str | None
    """The placeholder of the value in the help; None for a switch."""
    help: str
    kind: Any
    """The type of what is typed; a list for an option that can be repeated."""
    read: Callable[[str], Any] | None
    """The function that turns an item of a list into a value; None for other types."""
    group: str
    """The group in the help."""

    @property
    def argument(self) -> str:
        """The name of the Python argument that receives the value."""
        return self.setting.replace(".", "_")

    def parameter(self) -> inspect.Parameter:
        """Return the parameter from which Typer makes the option."""
        names = (self.metavar or "").split("|")
        is_choice = all(re.fullmatch("[a-z_]+", name) for name in names)
        option = typer.Option(
            *self.flags,
            metavar=self.metavar,
            autocompletion=(lambda: names) if is_choice else None,
            show_default=False,
            help=self.help,
            readable=False,  # a file is checked when it is opened
            rich_help_panel=self.group,
        )
        return inspect.Parameter(
            self.argument,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[self.kind | None, option],
        )

    def value(self, words: Any) -> Any:
        """Return the value of the words of an option; None if it was not given."""
        if self.read is None:
            return None if words == [] else words
        return [self.read(word) for word in words] if words else None


def _make_options() -> Iterator[Option]:
    for table, (settings, group) in TABLES.items():
        hints, texts = get_type_hints(settings, include_extras=True), meanings(settings)
        for field in dataclasses.fields(settings):
            hint = hints[field.name]
            flag = next((extra for extra in get_args(hint)[1:] if isinstance(extra, Flag)), None)
            if flag is None:
                continue
            flags = tuple(flag.names.split())
            kind, read = _kind(hint, f"{flags[-1]} {flag.metavar.partition('=')[0]}")
            # The help is the first sentence of the setting's meaning, and its default.
            meaning = " ".join(texts[field.name].replace("``", "").split())
            first, *others = re.split(r"(?<=[.:]) (?=[A-Z])", meaning)
            sentences = [first, *(text for text in others if text.startswith("Default"))]
            if get_origin(kind) is list:
                sentences.append("Repeatable.")
            elif field.default and field.default is not dataclasses.MISSING and kind is not bool:
                sentences.append(f"Default: {field.default}.")
            setting = f"{table}.{field.name}".removeprefix(".")
            heading = MOST_USED if setting in FIRST else flag.group or group
            help_text = " ".join(sentences)
            yield Option(setting, flags, flag.metavar or None, help_text, kind, read, heading)


def _kind(hint: Any, names: str) -> tuple[Any, Callable[[str], Any] | None]:
    """Return the type that Typer reads for a setting's type, and the function that reads an item.

    ``names`` is the flag and the placeholder of the name in its value, such as ``--net NAME``.
    """
    kind = _without_metadata(hint)
    match get_origin(kind):
        case None:
            return kind, None
        case typing.Literal:
            return str, None
        case builtins.tuple:
            readers: Mapping[type, Callable[[str], Any]] = {str: str, int: read_label}
            return list[str], readers.get(_without_metadata(get_args(kind)[0]), read_color)
        case _:
            return list[str], partial(read_named, names, alone=get_args(kind)[1] is not str)


def _without_metadata(hint: Any) -> Any:
    """Return a type without its metadata, and without None."""
    while get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, types.UnionType):
        return _without_metadata(
            next(kind for kind in get_args(hint) if kind is not types.NoneType)
        )
    return hint


def read_label(text: str) -> int | str:
    """Return the value of a label, or the name of its class."""
    return int(text) if re.fullmatch(r"-?[0-9]{1,18}", text) else text


def read_color(text: str) -> tuple[int, ...]:
    """Return the numbers of ``R,G,B``."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"{text!r} is not R,G,B (as 128,64,128)")
    return tuple(int(part) for part in parts)


def read_named(names: str, text: str, *, alone: bool = False) -> tuple[str, str | None]:
    """Return the parts of ``NAME=VALUE``; for ``names`` see `_kind`.

    With ``alone`` the text may be a name without a value, if it cannot be a path.
    """
    if alone and not ("=" in text or Path(text).suffix or Path(text).name != text):
        return text, None
    *name, value = text.split("=", 1)
    if not value:
        raise typer.BadParameter(f"{text!r} has nothing after '='; write {names}=VALUE")
    if not any(name):
        flag = names.partition(" ")[0]
        raise typer.BadParameter(f"{text!r}: write {names}={value}, as {flag} mine={value}")
    return name[0], value


OPTIONS: Final = tuple(
    sorted(
        _make_options(),
        key=lambda option: (
            GROUPS.index(option.group),
            (*FIRST, option.setting).index(option.setting),
        ),
    )
)
"""All options, in the order of the help."""
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

    def flag_of(setting: str) -> str:
        match setting.split(".", 2):
            case "masks", name, key:
                return f"`{key}` in the file of {FLAGS['masks']} {name}=FILE.toml"
            case "net", key:
                return f"`{key}` in the file of {FLAGS['nets']} NAME=FILE.toml"
            case "topics", "masks", name:
                return f"{FLAGS['topics.masks']} {name}"
        return FLAGS.get(setting, f"`{setting}`")

    return str(name_settings(text, flag_of))


def takes(*settings: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator: the command takes options, and receives their values as ``options``.

    ``settings`` are names in `OPTIONS`, or of whole tables. A ValueError for any other name.
    """
    names_of = {option: {option.setting, option.setting.partition(".")[0]} for option in OPTIONS}
    if unknown := {*settings}.difference(*names_of.values()):
        raise ValueError(f"no option sets {', '.join(sorted(unknown))}")
    taken = [option for option, names in names_of.items() if names & {*settings}]

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        @wraps(command)
        def run(*args: Any, context: typer.Context, **values: Any) -> int:
            # Options are in the order in which they were typed.
            typed_first = [*context.params]
            in_order = sorted(taken, key=lambda option: typed_first.index(option.argument))
            read = {o.setting: o.value(values.pop(o.argument, None)) for o in in_order}
            options = {setting: value for setting, value in read.items() if value is not None}
            return command(*args, options=options, **values)

        # The options stand after the arguments, and before the command's own options.
        signature = inspect.signature(command, eval_str=True)
        parameters = [p for p in signature.parameters.values() if p.name != "options"]
        arguments = [p for p in parameters if p.kind is not p.KEYWORD_ONLY]
        others = [p for p in parameters if p.kind is p.KEYWORD_ONLY]
        kind = inspect.Parameter.KEYWORD_ONLY
        context = inspect.Parameter("context", kind, annotation=typer.Context)
        parameters = [*arguments, *(option.parameter() for option in taken), *others, context]
        run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        return run

    return decorate
