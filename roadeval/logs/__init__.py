"""Camera logs (MCAP) in and out. No other room knows MCAP."""

from roadeval.logs.damage import Damage
from roadeval.logs.description import LogDescription, describe
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.frames import Accounting, FrameStream
from roadeval.logs.labels import LabelValues
from roadeval.logs.log import Log, open_log
from roadeval.logs.logged import LoggedFrame
from roadeval.logs.messages import Kind
from roadeval.logs.pack import Packed, pack
from roadeval.logs.selection import LabelTopic, Selection
from roadeval.logs.sidecar import NoSidecar, SidecarWriter
from roadeval.logs.span import Instant, Span, parse_time
from roadeval.logs.topics import TopicInfo
from roadeval.logs.writer import LogWriter

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
