"""The options that several commands share, each said once.

What can be seen to be wrong without opening a file is wrong usage, by the rooms' own rules.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from roadeval.errors import RoadevalError

option = partial(typer.Option, show_default=False)

_SELECTION: Final = re.compile(r"all|masks|none|(worst|every):[1-9]\d*")


class PresetName(StrEnum):
    """What a run starts from."""

    PAPER = "paper"
    PRINTED = "printed"
    GATED = "gated"
    ROBUST = "robust"


def split_variant(text: str) -> tuple[str, Path]:
    """Read ``NAME=FILE.toml``."""
    name, _, file = text.partition("=")
    if not name or not file:
        raise typer.BadParameter(f"{text!r} is not NAME=FILE.toml")
    return name, Path(file)


@contextmanager
def usage() -> Iterator[None]:
    """Turn a known problem inside the block into wrong usage."""
    try:
        yield
    except RoadevalError as error:
        raise typer.BadParameter(str(error)) from error


def _checked(check: Callable[[Any], object]) -> Callable[[Any], Any]:
    """Make an option's callback from a check that is made where the option is given."""

    def callback(value: Any) -> Any:
        if value is not None:
            with usage():
                check(value)
        return value

    return callback


def split_mask(text: str) -> tuple[str, str]:
    """Read ``NAME=TOPIC``."""
    name, _, topic = text.partition("=")
    if not name or not topic:
        raise typer.BadParameter(f"{text!r} is not NAME=TOPIC")
    return name, topic


def color(text: str) -> tuple[int, int, int]:
    """Read ``R,G,B``, 0..255 each."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"{text!r} is not R,G,B (as 128,64,128)")
    red, green, blue = (int(part) for part in parts)
    return red, green, blue


def _colors(texts: Sequence[str]) -> None:
    for text in texts:
        color(text)


def _mask_names(texts: Sequence[str]) -> None:
    _names(split_mask(text)[0] for text in texts)


def _variant_names(texts: Sequence[str]) -> None:
    _names(split_variant(text)[0] for text in texts)


def _names(names: Iterable[str]) -> None:
    from roadeval.config import check_variant_name
    from roadeval.data import FILTERED, UNFILTERED

    taken = {FILTERED, UNFILTERED}
    for name in names:
        check_variant_name(name, taken)
        taken.add(name)


def _time(text: str) -> None:
    from roadeval.logs import parse_time

    parse_time(text)


def _scale(value: float) -> None:
    if not 0 < value <= 1:
        raise typer.BadParameter(f"{value:g} is not above 0 and at most 1")


def _selection(text: str) -> None:
    if not _SELECTION.fullmatch(text):
        raise typer.BadParameter(f"{text!r} is none of all, masks, worst:K, every:N, none")


Drive = Annotated[
    Path, typer.Argument(metavar="DRIVE", show_default=False, help="A camera log (MCAP).")
]

Result = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT", show_default=False, help="A recording (.rrd), or a results folder."
    ),
]

Preset = Annotated[
    PresetName | None,
    option(
        "--preset",
        metavar="paper|printed|gated|robust",
        help="The equations as meant, or with the misprints taken literally; with a filter that "
        "does no harm; or for use on a road. Default: paper.",
    ),
]
ConfigFile = Annotated[
    Path | None, option("--config", metavar="FILE.toml", help="Settings on top of the preset.")
]
Variants = Annotated[
    list[str] | None,
    option(
        "--variant",
        metavar="NAME=FILE.toml",
        callback=_checked(_variant_names),
        help="One more variant beside filtered and unfiltered. Repeatable.",
    ),
]

ModelFile = Annotated[
    Path | None,
    option(
        "--model",
        metavar="FILE",
        help="Made by 'roadeval train'. Default: the drive's first frames train one.",
    ),
]
TrainFrames = Annotated[
    int | None,
    option(
        "--train-frames",
        metavar="N",
        min=1,
        help="Labelled frames to train on, which are never evaluated. Default: 10.",
    ),
]
TrainGap = Annotated[
    int | None,
    option(
        "--train-gap",
        metavar="N",
        min=0,
        help="Frames to leave out after those trained on. Default: 0.",
    ),
]

ImageTopic = Annotated[
    str | None,
    option("--image-topic", metavar="T", help="The camera, where the log has several."),
]
TruthTopic = Annotated[
    str | None,
    option("--truth-topic", metavar="T", help="The label images that say where road is."),
]
ShadowTopic = Annotated[
    str | None,
    option("--shadow-topic", metavar="T", help="The masks that say where shadow truly is."),
]
RoadLabels = Annotated[
    list[int] | None,
    option("--road-label", metavar="V", min=0, help="A truth value that is road. Repeatable."),
]
IgnoreLabels = Annotated[
    list[int] | None,
    option(
        "--ignore-label", metavar="V", min=0, help="A truth value to count nowhere. Repeatable."
    ),
]
RoadColors = Annotated[
    list[str] | None,
    option(
        "--road-color",
        metavar="R,G,B",
        callback=_checked(_colors),
        help="A truth colour that is road. Repeatable.",
    ),
]
IgnoreColors = Annotated[
    list[str] | None,
    option(
        "--ignore-color",
        metavar="R,G,B",
        callback=_checked(_colors),
        help="A truth colour to count nowhere. Repeatable.",
    ),
]
MaskTopics = Annotated[
    list[str] | None,
    option(
        "--mask-topic",
        metavar="NAME=TOPIC",
        callback=_checked(_mask_names),
        help="Score masks that the log carries, as one more variant. Repeatable.",
    ),
]
SyncTolerance = Annotated[
    float | None,
    option(
        "--sync-tolerance",
        metavar="MS",
        min=0,
        help="How far truth and image may be apart. Default: half a frame period.",
    ),
]
ResizeTruth = Annotated[
    bool, option("--resize-truth", help="Bring truth of another size to the image's.")
]
Scale = Annotated[
    float,
    option(
        "--scale",
        metavar="F",
        callback=_checked(_scale),
        help="Reduce frames and truth to this share of their size first: quicker, and coarser.",
    ),
]
KeepCorrupt = Annotated[bool, option("--keep-corrupt", help="Use data whose checksum is wrong.")]

Start = Annotated[
    str | None,
    option(
        "-S",
        "--start",
        metavar="TIME",
        callback=_checked(_time),
        help="Seconds from the log's start, nanoseconds, or RFC 3339.",
    ),
]
End = Annotated[
    str | None,
    option(
        "-E",
        "--end",
        metavar="TIME",
        callback=_checked(_time),
        help="Likewise; a frame at that very time is not read.",
    ),
]
Every = Annotated[int, option("--every", metavar="N", min=1, help="Read every N-th frame.")]
MaxFrames = Annotated[
    int | None, option("--max-frames", metavar="N", min=1, help="Stop after N frames read.")
]

Jobs = Annotated[
    int | None, option("--jobs", metavar="N", min=1, help="Workers. Default: one a processor.")
]
Record = Annotated[
    str,
    option(
        "--record",
        metavar="WHAT",
        callback=_checked(_selection),
        help="all (the default), masks, worst:K, every:N or none.",
    ),
]
Json = Annotated[bool, option("--json", help="Print the result on stdout as JSON.")]
Quiet = Annotated[bool, option("-q", "--quiet", help="No progress and no table; warnings stay.")]
