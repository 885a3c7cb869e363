"""Rerun out and back in: nobody else knows Rerun."""

from roadeval.recording.layout import RESERVED, Layout, RecordingError
from roadeval.recording.read.recording import Recording
from roadeval.recording.write.encoding import Encoded
from roadeval.recording.write.keeping import Keeper, Rule, recorder_for
from roadeval.recording.write.recorder import NullRecorder, Recorder

__all__ = [
    "RESERVED",
    "Encoded",
    "Keeper",
    "Layout",
    "NullRecorder",
    "Recorder",
    "Recording",
    "RecordingError",
    "Rule",
    "recorder_for",
]
