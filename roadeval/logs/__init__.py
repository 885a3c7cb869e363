"""Camera logs (MCAP) in and out. No other room knows MCAP."""

from roadeval.logs.container.damage import Damage
from roadeval.logs.description import LogDescription, describe
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.frames import Accounting, FrameStream
from roadeval.logs.log import Log, open_log
from roadeval.logs.logged import LoggedFrame
from roadeval.logs.messages.pictures import Kind
from roadeval.logs.topics.description import TopicInfo
from roadeval.logs.topics.labels import LabelValues
from roadeval.logs.topics.selection import LabelTopic, Selection
from roadeval.logs.topics.span import Instant, Span, parse_time
from roadeval.logs.writing.pack import Packed, pack
from roadeval.logs.writing.sidecar import NoSidecar, SidecarWriter
from roadeval.logs.writing.writer import LogWriter

__all__ = [
    "Accounting",
    "Damage",
    "FrameError",
    "FrameStream",
    "Instant",
    "Kind",
    "LabelTopic",
    "LabelValues",
    "Log",
    "LogDescription",
    "LogError",
    "LogWriter",
    "LoggedFrame",
    "NoSidecar",
    "Packed",
    "Selection",
    "SidecarWriter",
    "Span",
    "TopicInfo",
    "describe",
    "open_log",
    "pack",
    "parse_time",
]
