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

Messages that C libraries of codecs write to standard error are shown; only the command line drops
them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from roadeval.version import VERSION

if TYPE_CHECKING:
    from roadeval.config.run import RunConfig, config_toml, configure, load_config
    from roadeval.errors import RoadevalError
    from roadeval.jobs.log_files import demo, info, pack
    from roadeval.jobs.progress import Progress
    from roadeval.jobs.results.audit import audit
    from roadeval.jobs.results.clip import clip
    from roadeval.jobs.results.compare import compare
    from roadeval.jobs.results.history import history
    from roadeval.jobs.results.pick import pick
    from roadeval.jobs.results.report import write_figures, write_report
    from roadeval.jobs.results.result import Result
    from roadeval.jobs.run.fleet import FleetOutcome, replay_fleet
    from roadeval.jobs.run.frame import run_frame
    from roadeval.jobs.run.replay import Outcome, replay
    from roadeval.jobs.run.train import train
    from roadeval.recording.recording import Recording
    from roadeval.training.model import Model, load_model, save_model

__version__ = VERSION

__all__ = [
    "FleetOutcome",
    "Model",
    "Outcome",
    "Progress",
    "Recording",
    "Result",
    "RoadevalError",
    "RunConfig",
    "audit",
    "clip",
    "compare",
    "config_toml",
    "configure",
    "demo",
    "history",
    "info",
    "load_config",
    "load_model",
    "pack",
    "pick",
    "replay",
    "replay_fleet",
    "run_frame",
    "save_model",
    "train",
    "write_figures",
    "write_report",
]

_MODULES: Final = {
    "config.run": ("RunConfig", "config_toml", "configure", "load_config"),
    "errors": ("RoadevalError",),
    "jobs.log_files": ("demo", "info", "pack"),
    "jobs.progress": ("Progress",),
    "jobs.results.audit": ("audit",),
    "jobs.results.clip": ("clip",),
    "jobs.results.compare": ("compare",),
    "jobs.results.history": ("history",),
    "jobs.results.pick": ("pick",),
    "jobs.results.report": ("write_figures", "write_report"),
    "jobs.results.result": ("Result",),
    "jobs.run.fleet": ("FleetOutcome", "replay_fleet"),
    "jobs.run.frame": ("run_frame",),
    "jobs.run.replay": ("Outcome", "replay"),
    "jobs.run.train": ("train",),
    "recording.recording": ("Recording",),
    "training.model": ("Model", "load_model", "save_model"),
}
"""The public names of each module; a module is imported when one of its names is first used."""


if not TYPE_CHECKING:  # there every name is known

    def __getattr__(name: str) -> Any:
        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(f"{__name__}.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
