"""What a run is asked for, what it tells meanwhile, and what it gives."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from roadeval import logs
from roadeval.config import Config, Variant, check_variant_name, override, variants_of
from roadeval.errors import RoadevalError
from roadeval.training import TrainingSettings

Color = tuple[int, int, int]
AnyPath = str | Path


class OptionError(RoadevalError):
    """An option that cannot be followed."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """How a log is replayed; the defaults are those of ``roadeval replay``.

    Parameters
    ----------
    config
        The configuration of the variants ``filtered`` and ``unfiltered``.
    variants
        Further variants by name.
    model
        A model file; else the log itself trains one.
    image_topic, truth_topic, shadow_topic
        Topics, where the log leaves a choice.
    mask_topics
        Topics of road masks that the log already carries, by the name of their variant: a
        network's output, say, which is then scored beside the pipeline.
    road_labels, ignore_labels
        Values of the truth that mean road, and that are counted nowhere.
    road_colors, ignore_colors
        The same for a truth of colours: red, green, blue, 0..255 each.
    start, end
        Range by log time: seconds from the start, nanoseconds, or RFC 3339; the end is not in it.
    every, max_frames
        Read every so many frames, and at most so many.
    sync_tolerance_ms
        How far a truth's stamp may lie from its image's; half the frame period by default.
    train_frames, train_gap
        Override the configuration's ``training.frames`` and ``training.gap``.
    jobs
        Worker threads; as many as there are processors by default. Changes no number.
    record
        Whose pictures are recorded: ``all``, ``masks``, ``worst:K``, ``every:N`` or ``none``.
    keep_corrupt
        Keep messages whose checksum is wrong.
    resize_truth
        Bring a truth of another size to the image's, nearest pixel.
    scale
        Reduce frames and truth to this share of their width and height first: a cheaper look at
        a long log, with other results.
    """

    config: Config = field(default_factory=Config)
    variants: Mapping[str, Config] = field(default_factory=dict)
    model: Path | None = None
    image_topic: str | None = None
    truth_topic: str | None = None
    shadow_topic: str | None = None
    mask_topics: Mapping[str, str] = field(default_factory=dict)
    road_labels: tuple[int, ...] = ()
    ignore_labels: tuple[int, ...] = ()
    road_colors: tuple[Color, ...] = ()
    ignore_colors: tuple[Color, ...] = ()
    start: str | None = None
    end: str | None = None
    every: int = 1
    max_frames: int | None = None
    sync_tolerance_ms: float | None = None
    train_frames: int | None = None
    train_gap: int | None = None
    jobs: int | None = None
    record: str = "all"
    keep_corrupt: bool = False
    resize_truth: bool = False
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.scale <= 1:
            raise OptionError(f"--scale {self.scale:g}: must be above 0 and at most 1")

    def check_sidecar(self, mcap: AnyPath | None) -> None:
        """Refuse, as an `OptionError`, a log of masks that would not fit the images' own."""
        if mcap is not None and self.scale != 1:
            raise OptionError(
                "--mcap and --scale do not go together: reduced masks would not lie over the "
                "log's images"
            )

    def select(self, log: logs.Log) -> logs.Selection:
        """Settle what of a log is replayed."""
        return log.select(self.topics(), self.labels(), scale=self.scale)

    def topics(self) -> logs.TopicSettings:
        """Return the topics."""
        return logs.TopicSettings(
            self.image_topic, self.truth_topic, self.shadow_topic, self.mask_topics,
            self.sync_tolerance_ms, self.resize_truth,
        )  # fmt: skip

    def labels(self) -> logs.LabelSettings:
        """Return what the truth's values, or colours, mean."""
        return logs.LabelSettings(
            self.road_labels, self.ignore_labels, self.road_colors, self.ignore_colors
        )

    def span(self) -> logs.Span:
        """Return the part of the log that is read."""
        settings = logs.FrameSettings(self.start, self.end, self.every, self.max_frames)
        return logs.Span.of(settings)

    def all_variants(self) -> tuple[Variant, ...]:
        """Give every variant that is computed: the two by default, then the extra ones."""
        variants = variants_of(self.config, self.variants)
        for name in self.mask_topics:
            check_variant_name(name, {variant.name for variant in variants})
        return variants

    def training(self) -> TrainingSettings:
        """Give the configuration's training settings with the options' own on top."""
        given = {"frames": self.train_frames, "gap": self.train_gap}
        wanted = {name: value for name, value in given.items() if value is not None}
        settings: TrainingSettings = override(self.config.training, wanted, "--train-frames/-gap:")
        return settings

    def workers(self) -> int:
        """Give the number of worker threads."""
        if self.jobs is not None and self.jobs < 1:
            raise OptionError(f"--jobs {self.jobs}: at least one worker is needed")
        return self.jobs or os.cpu_count() or 1


def keep_apart(inputs: Iterable[AnyPath | None], outputs: Iterable[AnyPath | None]) -> None:
    """Refuse, as an `OptionError`, an output that would replace an input or another output."""
    taken = {Path(path).resolve() for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        if Path(path).resolve() in taken:
            raise OptionError(f"{path}: is an input or another output; name a file of its own")
        taken.add(Path(path).resolve())


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is.

    ``stage`` is ``compiling`` (the first time on a machine), ``training``, ``replaying`` or
    ``writing``.
    """

    done: int
    total: int | None
    stage: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run gave: where it stands, and the content of ``summary.json``."""

    recording: Path | None
    reports: Path | None
    summary: dict[str, Any]
    warnings: tuple[str, ...]
    losses: tuple[str, ...]
    files: tuple[Path, ...]
