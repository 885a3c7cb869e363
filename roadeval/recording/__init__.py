"""Rerun recordings: written during a replay, read back without the log. Nobody else knows Rerun.

Names are imported when they are first used: Rerun takes a second, and a `RecordRule` needs none.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.recording.layout import DamagedError, Layout, RecordingError, RecordRule
    from roadeval.recording.recorder import EncodedFrame, NullRecorder, Recorder, recorder_for
    from roadeval.recording.recording import Recording, rig_facts, run_toml_in

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
