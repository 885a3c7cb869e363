"""Oddities of a topic as a whole: images of several sizes, repeated ones, values at fringes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.pixels import size_of
from roadeval.logs.topics.pairing import UNREADABLE
from roadeval.logs.topics.reader import TopicReader

Size = tuple[int, int]


def survey(reader: TopicReader, size: Size | None) -> tuple[str, ...]:
    """Go through all messages of a topic whose images are of a size; return what is odd."""
    positions = range(len(reader))
    stamps = np.array([reader.stamp(position) for position in positions], np.int64)
    repeated = repeats(reader, positions, stamps)
    sizes = dict(_other_sizes(reader, size)) if size else {}
    return (*tell_sizes(sizes, len(reader), size), *tell_repeats(repeated, len(reader)))


def repeats(reader: TopicReader, positions: Sequence[int], stamps: npt.NDArray[np.int64]) -> int:
    """Count the messages that repeat an earlier one: the same stamp, and the same bytes."""
    order = np.argsort(stamps, kind="stable")
    same = np.diff(stamps[order]) == 0
    groups = np.split(order, np.flatnonzero(~same) + 1)
    return sum(
        _repeats_in(reader, [positions[i] for i in group])
        for group in groups
        if len(group) > 1 and stamps[group[0]] != UNREADABLE
    )


def _repeats_in(reader: TopicReader, positions: Iterable[int]) -> int:
    contents = []
    for position in positions:
        try:
            contents.append(bytes(reader.message(position).data))
        except FrameError:
            continue
    return len(contents) - len(set(contents))


def _other_sizes(reader: TopicReader, size: Size) -> Iterable[tuple[int, Size]]:
    """Yield the positions of images of another size, by what their heads say."""
    for position in range(len(reader)):
        try:
            found = size_of(reader.picture(position))
        except (FrameError, BadMessage):
            continue
        if found not in (None, size):
            yield position, found


def tell_sizes(others: Mapping[int, Size], total: int, size: Size | None) -> tuple[str, ...]:
    """Say that images of other sizes, by frame number, are among the ``total``; if they are."""
    if not others or size is None:
        return ()
    counts = Counter(others.values()).most_common()
    listed = ", ".join(f"{count} of {width}x{height}" for (width, height), count in counts)
    return (
        f"not all of the {total} images are {size[0]}x{size[1]}: {listed}, from frame "
        f"{min(others)} on",
    )


def tell_repeats(repeated: int, total: int) -> tuple[str, ...]:
    """Say that images are repeated, if they are."""
    if not repeated:
        return ()
    return (
        f"{repeated} of the {total} images repeat an earlier one, by stamp and content: each is "
        "counted as often as it is there",
    )


def tell_fringes(fringes: Mapping[tuple[int, str], tuple[int, int]]) -> tuple[str, ...]:
    """Say which share of a topic's labels is ignored, of `Accounting.fringes`; if any is."""
    sums: dict[str, tuple[int, int, int]] = {}
    for (_, topic), (pixels, size) in sorted(fringes.items()):
        images, ignored, all_pixels = sums.get(topic, (0, 0, 0))
        sums[topic] = images + 1, ignored + pixels, all_pixels + size
    return tuple(
        f"{topic}: {100 * ignored / size:.2g} % of the pixels of {images} label images are "
        "ignored, being farther than `labels.tolerance` from every known value"
        for topic, (images, ignored, size) in sums.items()
    )
