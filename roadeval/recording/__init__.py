"""Rerun out and back in: nobody else knows Rerun."""

from roadeval.recording.encoding import Encoded
from roadeval.recording.keeping import Keeper, Rule, recorder_for
from roadeval.recording.layout import RESERVED, Layout, RecordingError
from roadeval.recording.reading import Recording
from roadeval.recording.recorder import NullRecorder, Recorder

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
