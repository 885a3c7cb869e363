"""Camera logs (MCAP) in and out. No other room knows MCAP."""

from roadeval.logs.damage import Damage
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.frames import Accounting, FrameStream, LoggedFrame
from roadeval.logs.labels import LabelValues
from roadeval.logs.log import Log, open_log
from roadeval.logs.messages import Kind
from roadeval.logs.selection import LabelTopic, Selection
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
    "LogError",
    "LogWriter",
    "LoggedFrame",
    "Selection",
    "Span",
    "TopicInfo",
    "open_log",
    "parse_time",
]
