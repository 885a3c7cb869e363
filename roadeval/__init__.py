"""Logged-replay evaluation and visualisation of road recognition.

A drive is replayed, and its recording read, without the terminal:

>>> import roadeval
>>> outcome = roadeval.replay("drive.mcap", save="out.rrd")
>>> 0 <= outcome.summary["totals"]["filtered"]["post"]["ERR"] <= 1
True
>>> recording = roadeval.Recording("out.rrd")
>>> sorted(recording.frames.groupby("variant").ERR.mean().index)
['blind', 'filtered', 'unfiltered']
>>> recording.layer("filtered", "ndi", frame=12).shape
(48, 64)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from roadeval.version import VERSION

if TYPE_CHECKING:
    from roadeval.config import RunConfig, configure, load_config
    from roadeval.errors import RoadevalError
    from roadeval.jobs.frame import run_frame
    from roadeval.jobs.progress import Progress
    from roadeval.jobs.replay import Outcome, replay
    from roadeval.jobs.train import train
    from roadeval.recording import Recording
    from roadeval.training import Model, load_model, save_model

__version__ = VERSION

__all__ = [
    "Model",
    "Outcome",
    "Progress",
    "Recording",
    "RoadevalError",
    "RunConfig",
    "configure",
    "load_config",
    "load_model",
    "replay",
    "run_frame",
    "save_model",
    "train",
]

_HOMES: Final = {
    **dict.fromkeys(("RunConfig", "configure", "load_config"), "config"),
    **dict.fromkeys(("Outcome", "replay"), "jobs.replay"),
    "Progress": "jobs.progress",
    **dict.fromkeys(("Model", "load_model", "save_model"), "training"),
    "train": "jobs.train",
    "Recording": "recording",
    "RoadevalError": "errors",
    "run_frame": "jobs.frame",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that importing the package costs nothing."""
    if name not in _HOMES:
        raise AttributeError(f"module 'roadeval' has no attribute {name!r}")
    return getattr(import_module(f"roadeval.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
