"""Camera logs (MCAP) in and out. No other room knows MCAP.

A log goes from bytes to frames through its sub-rooms: ``container`` (records, chunks, damage),
``messages`` (pictures, whatever their encoding) and ``topics`` (which topics, and which label
belongs to which image); `Log.frames` puts them together. ``writing`` writes logs.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING, Final

from roadeval.runtime.on_demand import on_demand

if TYPE_CHECKING:
    from roadeval.logs.accounting import Accounting
    from roadeval.logs.container.damage import Damage
    from roadeval.logs.description import LogDescription, describe
    from roadeval.logs.errors import FrameError, LogError
    from roadeval.logs.frames import FrameStream
    from roadeval.logs.log import Log, open_log
    from roadeval.logs.logged_frame import LoggedFrame
    from roadeval.logs.masks.elsewhere import mask_stamp
    from roadeval.logs.messages.schemas import TopicKind
    from roadeval.logs.settings import FrameSettings, LabelSettings, MaskSettings, TopicSettings
    from roadeval.logs.span import Span
    from roadeval.logs.times import Instant, parse_time
    from roadeval.logs.topics.description import TopicInfo
    from roadeval.logs.topics.selection import LabelTopic, Selection
    from roadeval.logs.writing.pack import PackResult, pack
    from roadeval.logs.writing.sidecar import NoSidecar, SidecarWriter
    from roadeval.logs.writing.writer import LogWriter

__all__ = [
    "Accounting",
    "Damage",
    "FrameError",
    "FrameSettings",
    "FrameStream",
    "Instant",
    "LabelSettings",
    "LabelTopic",
    "Log",
    "LogDescription",
    "LogError",
    "LogWriter",
    "LoggedFrame",
    "MaskSettings",
    "NoSidecar",
    "PackResult",
    "Selection",
    "SidecarWriter",
    "Span",
    "TopicInfo",
    "TopicKind",
    "TopicSettings",
    "describe",
    "mask_stamp",
    "open_log",
    "pack",
    "parse_time",
]

_MODULES: Final = {
    "Accounting": "accounting",
    "Damage": "container.damage",
    "FrameError": "errors",
    "FrameSettings": "settings",
    "FrameStream": "frames",
    "Instant": "times",
    "LabelSettings": "settings",
    "LabelTopic": "topics.selection",
    "Log": "log",
    "LogDescription": "description",
    "LogError": "errors",
    "LogWriter": "writing.writer",
    "LoggedFrame": "logged_frame",
    "MaskSettings": "settings",
    "NoSidecar": "writing.sidecar",
    "PackResult": "writing.pack",
    "Selection": "topics.selection",
    "SidecarWriter": "writing.sidecar",
    "Span": "span",
    "TopicInfo": "topics.description",
    "TopicKind": "messages.schemas",
    "TopicSettings": "settings",
    "describe": "description",
    "mask_stamp": "masks.elsewhere",
    "open_log": "log",
    "pack": "writing.pack",
    "parse_time": "times",
}

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__, _MODULES)
