"""What a run asks of a log: topics, labels, and which frames are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

Level = Annotated[int, Field(ge=0, le=255)]
Color = tuple[Level, Level, Level]
"""Red, green and blue, 0..255 each."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class TopicSettings:
    """Topics, where the log leaves a choice, and how label images are paired with images.

    Parameters
    ----------
    image
        The camera's topic.
    truth
        The topic of label images that say where road is.
    shadow
        The topic of masks that say where shadow truly is.
    masks
        Topics of road masks that the log already carries, by the name of their variant: a
        network's output, for example, which is then scored beside the pipeline.
    sync_tolerance_ms
        Milliseconds between the stamps of an image and its label image, at most; half the frame
        period by default.
    resize_truth
        Whether label images of another size are scaled to the image's (nearest pixel).
    """

    image: str | None = None
    truth: str | None = None
    shadow: str | None = None
    masks: Mapping[str, str] = field(default_factory=dict)
    sync_tolerance_ms: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    resize_truth: bool = False


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class LabelSettings:
    """What the values, or the colours, of the truth mean; understood by itself where it is plain.

    Parameters
    ----------
    road
        Values that are road.
    ignore
        Values that are counted nowhere.
    road_colors
        Colours that are road, red, green and blue.
    ignore_colors
        Colours that are counted nowhere.
    """

    road: tuple[Annotated[int, Field(ge=0)], ...] = ()
    ignore: tuple[Annotated[int, Field(ge=0)], ...] = ()
    road_colors: tuple[Color, ...] = ()
    ignore_colors: tuple[Color, ...] = ()


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class FrameSettings:
    """Which frames of the log are read, and how.

    Parameters
    ----------
    start
        First log time: seconds from the log's start, nanoseconds, or RFC 3339.
    end
        Likewise; a frame at that very time is not read.
    every
        Read every so many frames.
    max_frames
        Stop after so many frames read.
    scale
        Reduce frames and truth to this share of their width and height first: a cheaper look at a
        long log, with other results.
    keep_corrupt
        Use messages whose checksum is wrong.
    """

    start: str | None = None
    end: str | None = None
    every: Annotated[int, Field(ge=1)] = 1
    max_frames: Annotated[int, Field(ge=1)] | None = None
    scale: Annotated[float, Field(gt=0, le=1)] = 1.0
    keep_corrupt: bool = False
