"""What a replay was asked of its log, as it stands in a summary and as it is typed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

TELLING: Final[Mapping[str, str]] = {
    "image_topic": "--image-topic",
    "truth_topic": "--truth-topic",
    "shadow_topic": "--shadow-topic",
    "mask_topics": "--mask-topic",
    "road_labels": "--road-label",
    "ignore_labels": "--ignore-label",
    "road_colors": "--road-color",
    "ignore_colors": "--ignore-color",
    "every": "--every",
    "sync_tolerance_ms": "--sync-tolerance",
    "resize_truth": "--resize-truth",
    "scale": "--scale",
}
"""Options of a replay, as typed, that change a frame's numbers or which frames are seen."""

_TYPED: Final[Mapping[str, str]] = {
    **TELLING,
    "start": "--start",
    "end": "--end",
    "max_frames": "--max-frames",
    "keep_corrupt": "--keep-corrupt",
}
_DEFAULTS: Final[Mapping[str, Any]] = {"every": 1, "scale": 1.0}


def typed(selection: Mapping[str, Any]) -> Iterator[str]:
    """Yield the words of a command line that asks the same of the log again.

    Parameters
    ----------
    selection
        The summary's part of this name: options by their names, at their defaults where they were
        not given. What changes no number, as ``record``, is left out.
    """
    for name, option in _TYPED.items():
        value = selection.get(name)
        # By identity: 0, which equals False, is asked for.
        if value is None or value is False or value in (_DEFAULTS.get(name), "", [], (), {}):
            continue
        if value is True:
            yield option
        elif isinstance(value, Mapping):
            for key, each in value.items():
                yield from (option, f"{key}={each}")
        elif isinstance(value, list | tuple):
            for each in value:
                yield from (option, _text(each))
        else:
            yield from (option, _text(value))


def _text(value: Any) -> str:
    """Write a number, a text, or a colour as it is typed."""
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
