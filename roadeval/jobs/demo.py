"""The synthetic drive with known truth."""

from __future__ import annotations

from pathlib import Path

from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.runtime.paths import AnyPath
from roadeval.synth import RenderSettings, write_drive


def demo(
    output: AnyPath,
    settings: RenderSettings | None = None,
    *,
    on_progress: OnProgress = ignore,
) -> Path:
    """Render the synthetic drive with known truth of road and shadow into a log.

    Parameters
    ----------
    output
        The log to write.
    settings
        What to render; by default 100 frames of 640x480 pixels at 10 Hz, with seed 0. The same
        settings give the same bytes.
    on_progress
        Called after every frame.

    Returns
    -------
    Path
        The log.

    Raises
    ------
    RoadevalError
        If the log cannot be written.

    Examples
    --------
    >>> import roadeval
    >>> from roadeval.synth import RenderSettings
    >>> log = roadeval.demo("short.mcap", RenderSettings(frames=2, width=64, height=48, seed=7))
    >>> [topic.name for topic in roadeval.info(log).topics]
    ['/camera/image', '/truth/road', '/truth/shadow']
    """
    path = Path(output)
    with holding(path):
        write_drive(
            path,
            settings or RenderSettings(),
            lambda done, total: on_progress(Progress(done, total, "rendering")),
        )
    return path
