"""The options that repeat settings of a run's configuration, each declared once.

A setting is named as in the configuration, ``table.key``. Its documentation, type and range stand
there; here stand its flag, a line of help, and how its words are read. No other module knows a
flag: errors name settings, and `with_flags` replaces these names.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, Final

from roadeval.cli.option import Option, color, named, switch, variant

OPTIONS: Final = (
    Option("output.save", ("--save",), "OUT.rrd", "Recording. Default: recordings/<drive>.rrd"),
    Option(
        "output.reports", ("--reports",), "DIR", "Tables and figures. Default: reports/<drive>/"
    ),
    Option(
        "output.mcap", ("--mcap",), "OUT.mcap", "Masks and rates as a log, to open beside DRIVE."
    ),
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
        variant,
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
    ),
    Option(
        "training.model",
        ("--model",),
        "FILE",
        "Made by 'roadeval train'. Default: the drive's first frames train one.",
    ),
    switch(
        "training.adapt",
        "--adapt",
        "Let the model learn further from the drive's first frames, which are not evaluated then.",
    ),
    Option(
        "training.frames",
        ("--train-frames",),
        "N",
        "Labelled frames to train on, which are never evaluated. Default: 10.",
        int,
    ),
    Option(
        "training.placement",
        ("--train-on",),
        "WHERE",
        "The 'first' labelled frames, or some 'spread' along the drive. Default: first.",
    ),
    Option(
        "training.gap",
        ("--train-gap",),
        "N",
        "Frames to leave out after those trained on, or on both sides. Default: 0; spread: a "
        "quarter of their distance.",
        int,
    ),
    Option(
        "training.seeds",
        ("--seeds",),
        "N",
        "Train N times, each with another draw of pixels: shows how far the rates depend on it.",
        int,
    ),
    Option("topics.image", ("--image-topic",), "T", "The camera, where the log has several."),
    Option("topics.truth", ("--truth-topic",), "T", "The label images that say where road is."),
    Option("topics.shadow", ("--shadow-topic",), "T", "The masks that say where shadow truly is."),
    Option(
        "labels.road", ("--road-label",), "V", "A truth value that is road. Repeatable.", list[int]
    ),
    Option(
        "labels.ignore",
        ("--ignore-label",),
        "V",
        "A truth value to count nowhere. Repeatable.",
        list[int],
    ),
    Option(
        "labels.road_colors",
        ("--road-color",),
        "R,G,B",
        "A truth colour that is road. Repeatable.",
        list[str],
        color,
    ),
    Option(
        "labels.ignore_colors",
        ("--ignore-color",),
        "R,G,B",
        "A truth colour to count nowhere. Repeatable.",
        list[str],
        color,
    ),
    Option(
        "labels.tolerance",
        ("--label-tolerance",),
        "N",
        "For masks compressed as JPEG: ignore values farther than N from the known ones.",
        int,
    ),
    Option(
        "topics.masks",
        ("--mask-topic",),
        "NAME=TOPIC",
        "Score masks that the log carries, as one more variant. Repeatable.",
        list[str],
        named,
    ),
    Option(
        "topics.sync_tolerance_ms",
        ("--sync-tolerance",),
        "MS",
        "How far truth and image may be apart. Default: half a frame period.",
        float,
    ),
    switch("topics.resize_truth", "--resize-truth", "Bring truth of another size to the image's."),
    Option(
        "frames.scale",
        ("--scale",),
        "F",
        "Reduce frames and truth to this share of their size first: quicker, and coarser.",
        float,
    ),
    switch("frames.keep_corrupt", "--keep-corrupt", "Use damaged data as far as it goes."),
    Option(
        "frames.max_pixels",
        ("--max-pixels",),
        "N",
        "Leave out images of more pixels. Default: 33554432, a little more than 7680x4320.",
        int,
    ),
    Option(
        "frames.start",
        ("-S", "--start"),
        "TIME",
        "Seconds from the log's start, nanoseconds, or RFC 3339.",
    ),
    Option(
        "frames.end", ("-E", "--end"), "TIME", "Likewise; a frame at that very time is not read."
    ),
    Option("frames.every", ("--every",), "N", "Read every N-th frame.", int),
    Option("frames.max_frames", ("--max-frames",), "N", "Stop after N frames read.", int),
    Option(
        "output.record",
        ("--record",),
        "WHAT",
        "all (the default), masks, worst:K, every:N or none.",
    ),
    Option("run.jobs", ("--jobs",), "N", "Worker threads. Default: one per CPU core.", int),
    Option(
        "fleet.folds",
        ("--folds",),
        "K",
        "Score each drive by a model of others: deal drives, or their groups, into K folds.",
        int,
    ),
    Option(
        "fleet.keep", ("--keep",), "WHAT", "Recordings: all, those of the worst:N drives, or none."
    ),
    Option("fleet.workers", ("--workers",), "N", "Processes. Default: one per CPU core.", int),
    Option(
        "fleet.memory_gib",
        ("--memory",),
        "GIB",
        "What each process may take. Default: its share of the machine's.",
        float,
    ),
    Option(
        "fleet.scheduler",
        ("--scheduler",),
        "ADDRESS",
        "A Dask scheduler, as tcp://host:8786, or its file: its workers replay the drives.",
    ),
    Option(
        "fleet.max_failures",
        ("--max-failures",),
        "N|P%",
        "Exit with code 1 if more drives fail. Default: however many.",
    ),
)
"""In the order of the help."""

FLAGS: Final[Mapping[str, str]] = {option.setting: option.flags[-1] for option in OPTIONS} | {
    "trust_sources": "--trust-sources"
}
_MARKED: Final = re.compile(r"`(\w+(?:\.\w+)?)`")

Given = Mapping[str, Any]
"""Values of options by the names of their settings; one that was not typed is not there."""


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
            given = {o.setting: _value(o, values.pop(o.argument, None)) for o in chosen}
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


def _value(option: Option, typed: Any) -> Any:
    """Read what was typed; None where nothing was."""
    if option.read is None:
        return None if typed == [] else typed
    return [option.read(word) for word in typed] if typed else None
