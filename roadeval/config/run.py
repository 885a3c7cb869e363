"""The configuration of a run: one validated, frozen object that holds every option.

In a TOML file, and in the mapping that `configure` takes, it has this shape::

    preset = "paper"

    [shadow]                # a table for each stage of the chain
    ring_width = 3

    [variants.wide]         # a further variant: a preset, a chain, tables of its stages
    preset = "gated"

    [masks.net]             # masks of another method, from files
    path = "net/{drive}"

    [frames]                # and [topics], [labels], [training], [evaluation], [output], [run]
    every = 2               # and [fleet]

    [[cameras]]             # several cameras of a log: the topics of each
    name = "front"
    image = "/front/image"
"""

from __future__ import annotations

import dataclasses
import inspect
import os
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from roadeval.config.settings import SECTIONS, ExecutionSettings, FleetSettings, OutputSettings
from roadeval.config.tables import ConfigError, adapter, in_file, list_names, override, read_tables
from roadeval.config.variants import (
    PRESETS,
    TRAINED,
    Variant,
    check_tables,
    check_variant_name,
    in_drive,
    pipeline_of,
    preset_of,
    thresholded_variant,
    tuned_variant,
    variants_of,
    with_masks,
)
from roadeval.data import FILTERED, FINAL_STAGE, RESERVED, UNFILTERED
from roadeval.errors import RoadevalError
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.logs.settings import CameraSettings, LabelSettings, LogConfig
from roadeval.pipeline import stages
from roadeval.pipeline.chain import Pipeline
from roadeval.recording.layout import RecordRule
from roadeval.results.facts import focus_of
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.settings import meanings
from roadeval.runtime.text import likely, visible, visible_lines
from roadeval.training.settings import TrainingSettings

OF_A_LOG: Final[tuple[str, ...]] = ("topics", "truth", "labels", "frames", "masks", "ground")
"""The tables that can differ between drives."""


@dataclass(frozen=True)
class RunConfig(LogConfig):
    """Every option of a run; a `ConfigError` if they do not go together."""

    preset: str = "paper"
    """The preset that the other settings change."""
    pipeline: Pipeline = field(default_factory=lambda: pipeline_of(None, PRESETS["paper"]))
    """The chain of stages of the variants ``filtered`` and ``unfiltered``, and their settings; if
    the preset has no filter, the chain of one variant with the name of the preset."""
    extra: tuple[Variant, ...] = ()
    """Further variants."""
    only: tuple[str, ...] = ()
    """Names of the variants that run, masks of other methods included; empty for all."""
    cameras: tuple[CameraSettings, ...] = ()
    """The cameras of a rig; empty if one camera is replayed."""
    training: TrainingSettings = field(default_factory=TrainingSettings)
    evaluation: EvaluationSettings = field(default_factory=EvaluationSettings)
    """How every variant is trained and scored."""
    output: OutputSettings = field(default_factory=OutputSettings)
    """Where the results are written."""
    run: ExecutionSettings = field(default_factory=ExecutionSettings)
    """How the run is executed."""
    fleet: FleetSettings = field(default_factory=FleetSettings)
    """How many drives are replayed together."""

    def __post_init__(self) -> None:
        LogConfig.__post_init__(self)
        names = {variant.name for variant in variants_of(self.pipeline, self.extra, self.preset)}
        for name in (*self.topics.masks, *self.masks):
            check_variant_name(name, names)
            names.add(name)
        for name in self.only:
            if name not in names:
                remedy = f"{likely(name, names)}choose {list_names(names)}"
                raise ConfigError(f"there is no variant {name}", setting="only", remedy=remedy)
        self._check_cameras()
        try:
            RecordRule.parse(self.output.record)
        except RoadevalError as error:
            raise ConfigError.of(error) from error
        for key, ending in (("save", ".rrd"), ("mcap", ".mcap")):
            path = getattr(self.output, key)
            if path is not None and not path.endswith(ending):
                problem = f"{path} does not end in {ending}"
                raise ConfigError(problem, setting=f"output.{key}")
        if self.output.mcap is not None and self.frames.scale != 1:
            problem = "does not go with {frames.scale}: reduced masks would not lie over the images"
            raise ConfigError(Sentence(problem), setting="output.mcap")

    def _check_cameras(self) -> None:
        names = [visible(camera.name or camera.image) for camera in self.cameras]
        for name in names:
            if names.count(name) > 1:
                raise ConfigError("the name is given twice", where=f"camera {name}")
            if name.strip("/").partition("/")[0] in RESERVED:
                remedy = "give it another under [[cameras]]"
                raise ConfigError("the name is reserved", where=f"camera {name}", remedy=remedy)
        topics = ("image", "truth", "shadow", "masks")
        single = [f"topics.{name}" for name in topics if getattr(self.topics, name)]
        single += ["ground"] * self.ground.given
        if names and single:
            problem, remedy = "belongs to one of several cameras", "set it under [[cameras]]"
            raise ConfigError(problem, setting=single[0], remedy=remedy)
        if names and (self.truth.path or self.masks):
            problem = "labels from files belong to one camera, and there are several"
            raise ConfigError(problem, remedy="replay that camera alone")

    def variants(self) -> tuple[Variant, ...]:
        """Return the variants that are computed: the two by default, then the extra ones."""
        trained = [name for name, masks in self.masks.items() if masks.decide == TRAINED]
        made = variants_of(self.pipeline, self.extra, self.preset)
        variants = (*made, *map(thresholded_variant, trained))
        return tuple(v for v in variants if not self.only or v.name in self.only)

    def names(self) -> list[str]:
        """Return the names of all variants that run, masks of other methods last."""
        topics = (self.topics.masks, *(camera.masks for camera in self.cameras))
        masks = [name for named in (*topics, self.masks) for name in named]
        names = dict.fromkeys([*(variant.name for variant in self.variants()), *masks])
        return [name for name in names if not self.only or name in self.only]

    def brought(self) -> list[str]:
        """Return the names of the variants that are not the preset's, in the order of `names`."""
        preset_names = {variant.name for variant in variants_of(self.pipeline, (), self.preset)}
        return [name for name in self.names() if name not in preset_names]

    def check_focus(self, names: Iterable[str]) -> None:
        """Raise a `ConfigError` if the chosen focus is none of these variants."""
        try:
            focus_of(names, self.output.focus)
        except RoadevalError as error:
            raise ConfigError.of(error) from error

    def by_camera(self) -> dict[str, RunConfig]:
        """Return each camera's configuration by its name; a single camera has the name ``""``."""
        if not self.cameras:
            return {"": self}
        configs = {}
        for camera in self.cameras:
            topics: dict[str, Any] = {"image": camera.image, "masks": camera.masks}
            # An empty topic of truth or shadow under [topics] means that no camera has one.
            for name in ("truth", "shadow"):
                if (topic := getattr(camera, name)) is not None:
                    topics[name] = topic
            configs[visible(camera.name or camera.image)] = replace(
                self, cameras=(), ground=camera.ground, topics=replace(self.topics, **topics)
            )
        return configs

    def pipelines(self) -> dict[str, Pipeline]:
        """Return the pipelines of the variants by name."""
        return {variant.name: variant.pipeline for variant in self.variants()}

    def others_code(self) -> dict[str, str]:
        """Return the code digests of other packages' stages, by their names in a chain."""
        return {
            name: stage.code
            for pipeline in self.pipelines().values()
            for name, stage in zip(pipeline.chain, pipeline.stages(), strict=True)
            if stage.code is not None
        }

    def resolved(self) -> RunConfig:
        """Return the configuration with the settings that stages read from files.

        The first variant that the user brought is the focus, also if the preset has no filter. A
        `RoadevalError` if a file cannot be used, or no stage of a variant makes a mask for its
        final stage.
        """
        for name, pipeline in self.pipelines().items():
            if len(pipeline.masks()) < 2:  # one of the final stage, and one before it
                chain = ", ".join(pipeline.chain)
                problem = f"no stage of its chain ({chain}) makes a road mask for {FINAL_STAGE}"
                raise ConfigError(problem, where=f"variant {name}", remedy="add such a stage")
        config = self._with_pipelines(Pipeline.resolved)
        brought = self.brought()
        by_itself = focus_of(self.names())
        if self.output.focus is None and brought and by_itself not in brought:
            config = replace(config, output=replace(self.output, focus=brought[0]))
        return config

    def without_places(self) -> RunConfig:
        """Return the configuration without the stages' settings that are paths of files."""
        return self._with_pipelines(Pipeline.without_places)

    def _with_pipelines(self, change: Callable[[Pipeline], Pipeline]) -> RunConfig:
        extra = tuple(replace(variant, pipeline=change(variant.pipeline)) for variant in self.extra)
        return replace(self, pipeline=change(self.pipeline), extra=extra)

    def override(self, tables: Mapping[str, Any]) -> RunConfig:
        """Return the configuration, changed by the values of some tables.

        The tables have the shape of a TOML file, without ``preset``; a variant replaces one of the
        same name. A `ConfigError` for a key or a value that cannot be used, with what is allowed.
        """
        pipeline = pipeline_of(self.pipeline, tables)
        names = ("chain", "only", *pipeline.settings, "variants", "masks", "cameras", *SECTIONS)
        check_tables(tables, names)
        only = tables.get("only", self.only)
        if not isinstance(only, list | tuple) or not all(isinstance(name, str) for name in only):
            raise ConfigError("must be a list of variants' names", setting="only")
        config = replace(
            self,
            pipeline=pipeline,
            only=tuple(only),
            extra=self._with_variants(tables.get("variants", {})),
            masks=with_masks(self.masks, tables.get("masks", {})),
            **{t: override(getattr(self, t), tables.get(t, {}), t) for t in SECTIONS},
        )
        if "cameras" not in tables:
            return config
        rig = tables["cameras"]
        if not isinstance(rig, list | tuple) or not all(isinstance(t, Mapping) for t in rig):
            raise ConfigError("cameras must be tables, each under [[cameras]]")
        for table in rig:
            if not table.get("image"):
                where = f"[[cameras]] {table.get('name', '')}".rstrip()
                raise ConfigError("image must name its topic", where=where)
        cameras = (override(CameraSettings(table["image"]), table, "cameras") for table in rig)
        return replace(config, cameras=tuple(cameras))

    def with_variants(self, variants: Iterable[Variant]) -> RunConfig:
        """Return the configuration with further variants; one replaces a variant of the same name.

        A `ConfigError` if masks or a default variant have the name.
        """
        extra = {variant.name: variant for variant in (*self.extra, *variants)}
        return replace(self, extra=tuple(extra.values()))

    def with_tuned(self, names: Iterable[str]) -> RunConfig:
        """Return the configuration with a tuned variant of each named method.

        A `ConfigError` if there is no such method, or it learns itself; see `tuned_variant`.
        """
        made = variants_of(self.pipeline, self.extra, self.preset)
        pipelines = {variant.name: variant.pipeline for variant in made}
        masks = {*self.topics.masks, *self.masks}
        variants = []
        for name in names:
            if name not in pipelines and name not in masks:
                methods = {*pipelines, *masks} - {FILTERED, UNFILTERED}
                remedy = f"{likely(name, methods)}choose {list_names(methods)}"
                raise ConfigError(f"there is no method {name}", setting="tunes", remedy=remedy)
            variants.append(tuned := tuned_variant(name, pipelines.get(name)))
            earlier = pipelines.get(tuned.name, tuned.pipeline)
            if earlier.chain != tuned.pipeline.chain:  # not the same of a run that is repeated
                check_variant_name(tuned.name, pipelines)
        return self.with_variants(variants)

    def input_masks(self) -> set[str]:
        """Return the names of the masks that the variants use as input."""
        settings = (pipeline.settings.get("given") for pipeline in self.pipelines().values())
        return {mask.name for mask in settings if mask is not None}

    def for_training(self) -> RunConfig:
        """Return the configuration with all variants, but only the masks that they use."""
        masks = {name: masks for name, masks in self.masks.items() if name in self.input_masks()}
        return replace(self, masks=masks, only=())

    def of_drive(self, tables: Mapping[str, Any]) -> RunConfig:
        """Return the configuration with the tables of `OF_A_LOG` of one drive.

        Its labels replace those of the run, the other tables replace single keys. A `ConfigError`
        for a table that is the same for all drives, or a value that cannot be used.
        """
        check_tables(tables, OF_A_LOG)
        labels = LabelSettings() if "labels" in tables else self.labels
        return replace(self, labels=labels).override(tables)

    def for_drive(self, path: str | os.PathLike[str]) -> RunConfig:
        """Return the configuration with the drive's name in the paths of masks and truth."""
        for name, masks in self.masks.items():
            if not masks.path:
                remedy = "give a folder, or LOG.mcap:/topic"
                raise ConfigError(f"[masks.{name}] has no path", remedy=remedy)
        used = {*self.masks, *self.topics.masks}
        if self.only:
            used &= {*self.only, *self.input_masks()}
        topics = {name: topic for name, topic in self.topics.masks.items() if name in used}
        return replace(
            self,
            masks={name: in_drive(self.masks[name], path) for name in self.masks if name in used},
            topics=replace(self.topics, masks=topics),
            truth=in_drive(self.truth, path),
        )

    def ignored_settings(self) -> tuple[str, ...]:
        """Return a note on each setting that a variant's preset asks for and the run ignores."""
        return tuple(
            f"{variant.name}: preset {variant.preset} asks for {section}.{key} = {value}, but all "
            f"variants of a run are trained and scored alike ({getattr(settings, key)})"
            for variant in self.extra
            for section in SECTIONS
            for key, value in PRESETS[variant.preset].get(section, {}).items()
            if getattr(settings := getattr(self, section), key) != value
        )

    def as_dict(self) -> dict[str, Any]:
        """Return every effective setting as plain data, in the shape of a TOML file.

        A file leaves out settings that are None.
        """
        masks = {name: dataclasses.asdict(masks) for name, masks in self.masks.items()}
        return {
            "preset": self.preset,
            **({"only": list(self.only)} if self.only else {}),
            **self.pipeline.as_dict(),
            "variants": {v.name: {"preset": v.preset, **v.pipeline.as_dict()} for v in self.extra},
            **({"masks": masks} if masks else {}),
            **{name: dataclasses.asdict(getattr(self, name)) for name in SECTIONS},
            **({"cameras": [*map(dataclasses.asdict, self.cameras)]} if self.cameras else {}),
        }

    def _with_variants(self, tables: Any) -> tuple[Variant, ...]:
        if not isinstance(tables, Mapping):
            raise ConfigError("[variants] must hold a table for each variant")
        variants = []
        for name, table in tables.items():
            if not isinstance(table, Mapping):
                raise ConfigError(f"[variants.{name}] must be a table")
            variants.append(Variant.of(name, table, f"[variants.{name}]"))
        return self.with_variants(variants).extra


def configure(tables: Mapping[str, Any] | None = None, *, where: str = "") -> RunConfig:
    """Return the configuration of a preset, changed by the values of some tables.

    Parameters
    ----------
    tables
        Tables in the shape of a TOML file. Their ``preset``, by default ``paper``, gives all other
        values.

    Raises
    ------
    ConfigError
        If a key or a value cannot be used. The message states what is allowed.

    Examples
    --------
    >>> config = configure({"preset": "gated", "frames": {"every": 2}})
    >>> config.pipeline.chain
    ('exposure', 'gated', 'similarity', 'svm', 'post')
    """
    tables = tables or {}
    with in_file(where):
        name = preset_of(tables)
        base = replace(RunConfig(), preset=name).override(PRESETS[name])
        return base.override({key: value for key, value in tables.items() if key != "preset"})


def load_config(path: str | Path, *, trusted: bool = True) -> RunConfig:
    """Read the configuration of a run from a TOML file.

    A `ConfigError` if the file is missing or not TOML, or has a key or a value that cannot be used.

    Parameters
    ----------
    path
        The file, in the shape that the top of this module describes.
    trusted
        Whether the user has named the file. A file that came with results, or in a recording, loads
        no code.
    """
    return configure(read_tables(path, trusted=trusted), where=str(path))


WIDTH: Final = 100
"""Greatest length of a line of comments."""
_BOUNDS: Final = {
    "minimum": "at least {}",
    "exclusiveMinimum": "above {}",
    "maximum": "at most {}",
    "exclusiveMaximum": "below {}",
}
"""The bounds of a JSON schema in words."""


def run_toml(config: RunConfig, drive: str, version: str, command: str = "replay") -> str:
    """Return the TOML file that repeats a run, with every effective setting."""
    head = (
        f"# The configuration of a {command} of {visible(drive)} by roadeval {version}.\n"
        f"# To repeat the run, give this file to roadeval {command} as its configuration."
    )
    lines = [line for line in config_toml(config).splitlines() if line and line[0] != "#"]
    text = "\n".join(f"\n{line}" if line[0] == "[" else line for line in lines)
    return visible_lines(f"{head}\n{text}\n")


def _without_none(value: Any) -> Any:
    """Return data for TOML: settings that are None are left out, and tuples become lists."""
    if isinstance(value, Mapping):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list | tuple) else value


def config_toml(config: RunConfig | None = None) -> str:
    """Return a configuration as TOML: every setting with its meaning, range and value.

    A setting without a value is a comment.

    Parameters
    ----------
    config
        The configuration; by default that of a plain ``roadeval replay``. The text can be edited
        and given to `roadeval.load_config`.

    Examples
    --------
    >>> import roadeval
    >>> text = roadeval.config_toml(roadeval.configure({"preset": "gated"}))
    >>> text.startswith('preset = "gated"')
    True
    """
    import tomlkit

    config = config or RunConfig()
    head = [_assignment("preset", config.preset), *_chain_lines(config.pipeline)]
    if config.only:
        head += [*_comment("The variants that run."), _assignment("only", config.only)]
    parts = ["\n".join(head), *_stage_tables(config.pipeline, "")]
    for variant in config.extra:
        head = [f"[variants.{variant.name}]", _assignment("preset", variant.preset)]
        parts.append("\n".join([*head, *_chain_lines(variant.pipeline)]))
        parts += _stage_tables(variant.pipeline, f"variants.{variant.name}.")
    parts += [_table(f"masks.{name}", masks) for name, masks in config.masks.items()]
    parts += [_table(name, getattr(config, name)) for name in SECTIONS]
    for camera in config.cameras:
        table = _without_none(dataclasses.asdict(camera))
        parts.append(tomlkit.dumps({"cameras": [table]}).strip())
    return "\n\n".join(parts) + "\n"


def _chain_lines(pipeline: Pipeline) -> list[str]:
    names = ", ".join(stages.names())
    comment = _comment(f"The stages in the order in which they run; there are {names}.")
    return [*comment, _assignment("chain", pipeline.chain)]


def _stage_tables(pipeline: Pipeline, prefix: str) -> list[str]:
    return [_table(f"{prefix}{name}", settings) for name, settings in pipeline.settings.items()]


def _table(name: str, settings: Any) -> str:
    """Return the table of a settings dataclass, and the tables of dataclasses in it."""
    title, comments = _comments(settings.__class__)
    lines, inner = [*title, f"[{name}]"], []
    for key, comment in comments.items():
        value = getattr(settings, key)
        if dataclasses.is_dataclass(value):
            inner.append(_table(f"{name}.{key}", value))
        else:
            lines += ["", *comment, _assignment(key, value)]
    return "\n\n".join(["\n".join(lines), *inner])


@cache
def _comments(kind: type) -> tuple[list[str], dict[str, list[str]]]:
    """Return the comment on a settings dataclass, and on each setting with its range."""
    texts, title = meanings(kind), (inspect.getdoc(kind) or "").partition("\n\n")[0]
    return _comment(title), {
        name: _comment(" ".join(filter(None, (texts.get(name), _allowed(schema)))))
        for name, schema in adapter(kind).json_schema()["properties"].items()
    }


def _assignment(name: str, value: Any) -> str:
    import tomlkit

    if value is None:
        return f"# {name} ="
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        table.update(_without_none(value))
        return f"{name} = {table.as_string()}"
    return f"{name} = {tomlkit.item(_without_none(value)).as_string()}"


def _comment(text: str) -> list[str]:
    words = " ".join(text.replace("``", "").split())
    return textwrap.wrap(words, WIDTH, initial_indent="# ", subsequent_indent="# ")


def _allowed(schema: Mapping[str, Any]) -> str:
    """Describe the values that a JSON schema allows; empty if it allows all."""
    for kind in (schema, *schema.get("anyOf", ())):
        if "enum" in kind:
            return f"One of {', '.join(map(str, kind['enum']))}."
        bounds = [text.format(kind[name]) for name, text in _BOUNDS.items() if name in kind]
        if bounds:
            return f"{', '.join(bounds).capitalize()}."
    return ""
