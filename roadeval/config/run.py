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
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from roadeval.config.settings import SECTIONS, ExecutionSettings, FleetSettings, OutputSettings
from roadeval.config.tables import ConfigError, adapter, either, in_file, override, read_tables
from roadeval.config.variants import (
    PRESETS,
    TRAINED,
    Variant,
    check_tables,
    check_variant_name,
    in_drive,
    pipeline_of,
    preset_of,
    thresholded,
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
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.settings import meanings
from roadeval.runtime.text import visible, visible_lines
from roadeval.training.settings import TrainingSettings

OF_A_LOG: Final[tuple[str, ...]] = ("topics", "truth", "labels", "frames", "masks", "ground")
"""The tables that may differ from drive to drive."""


@dataclass(frozen=True)
class RunConfig(LogConfig):
    """Every option of a run.

    A `ConfigError` if the parts do not go together.
    """

    preset: str = "paper"
    """The preset that it started from."""
    pipeline: Pipeline = field(default_factory=lambda: pipeline_of(None, PRESETS["paper"]))
    """The chain of stages of the variants ``filtered`` and ``unfiltered``, and their settings."""
    extra: tuple[Variant, ...] = ()
    """Further variants."""
    only: tuple[str, ...] = ()
    """The variants that run, masks of other methods included; all of them by default."""
    cameras: tuple[CameraSettings, ...] = ()
    """The cameras of a rig; none where one camera is replayed."""
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
        names = {variant.name for variant in variants_of(self.pipeline, self.extra)}
        for name in (*self.topics.masks, *self.masks):
            check_variant_name(name, names)
            names.add(name)
        for name in self.only:
            if name not in names:
                raise ConfigError(
                    f"there is no variant {name}", setting="only", remedy=f"choose {either(names)}"
                )
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
        names = [visible(each.name or each.image) for each in self.cameras]
        for name in names:
            if names.count(name) > 1:
                raise ConfigError(f"camera {name}: given twice")
            if name.strip("/").partition("/")[0] in RESERVED:
                raise ConfigError(
                    f"camera {name}: the name is reserved; give it another under [[cameras]]"
                )
        topics = ("image", "truth", "shadow", "masks")
        of_one = [f"topics.{name}" for name in topics if getattr(self.topics, name)]
        of_one += ["ground"] * self.ground.given
        if names and of_one:
            raise ConfigError(
                "belongs to one of several cameras",
                setting=of_one[0],
                remedy="name it under [[cameras]], beside its image",
            )
        if names and (self.truth.path or self.masks):
            raise ConfigError(
                "labels that do not lie in the log belong to one camera: replay that one alone"
            )

    def variants(self) -> tuple[Variant, ...]:
        """Return the variants that are computed: the two by default, then the extra ones."""
        trained = (thresholded(name) for name, own in self.masks.items() if own.decide == TRAINED)
        every = (*variants_of(self.pipeline, self.extra), *trained)
        return tuple(each for each in every if not self.only or each.name in self.only)

    def by_camera(self) -> dict[str, RunConfig]:
        """Return the configuration of each camera by its name; of one camera alone by ``""``."""
        if not self.cameras:
            return {"": self}
        configs = {}
        for camera in self.cameras:
            topics: dict[str, Any] = {"image": camera.image, "masks": camera.masks}
            # An empty name under [topics] takes no topic, of any camera.
            topics |= {"truth": camera.truth} if camera.truth is not None else {}
            topics |= {"shadow": camera.shadow} if camera.shadow is not None else {}
            configs[visible(camera.name or camera.image)] = replace(
                self, cameras=(), ground=camera.ground, topics=replace(self.topics, **topics)
            )
        return configs

    def pipelines(self) -> dict[str, Pipeline]:
        """Return the pipeline of every variant, by name."""
        return {variant.name: variant.pipeline for variant in self.variants()}

    def others_code(self) -> dict[str, str]:
        """Return the digests of stages that are not roadeval's own, by their names in a chain."""
        return {
            name: stage.code
            for pipeline in self.pipelines().values()
            for name, stage in zip(pipeline.chain, pipeline.stages(), strict=True)
            if stage.code is not None
        }

    def resolved(self) -> RunConfig:
        """Return the configuration with the settings that stages find in files.

        A `RoadevalError` if a file cannot be used, or a variant's final stage has no mask to start
        from.
        """
        for name, pipeline in self.pipelines().items():
            if len(pipeline.masks()) < 2:  # the final one, and one before it
                raise ConfigError(
                    f"variant {name}: its chain ({', '.join(pipeline.chain)}) has no stage before "
                    f"{FINAL_STAGE} that makes a road mask"
                )
        return self._with_pipelines(Pipeline.resolved)

    def without_places(self) -> RunConfig:
        """Return the configuration without the stages' settings that are paths of files."""
        return self._with_pipelines(Pipeline.without_places)

    def _with_pipelines(self, change: Callable[[Pipeline], Pipeline]) -> RunConfig:
        extra = tuple(replace(each, pipeline=change(each.pipeline)) for each in self.extra)
        return replace(self, pipeline=change(self.pipeline), extra=extra)

    def override(self, tables: Mapping[str, Any]) -> RunConfig:
        """Return the configuration with the values of some tables in place.

        A `ConfigError` for a key or a value that cannot be used names it, and what is allowed. The
        tables have the shape of a TOML file, without ``preset``; a variant of a name that is there
        is replaced.
        """
        pipeline = pipeline_of(self.pipeline, tables)
        check_tables(
            tables,
            (*("chain", "only", *pipeline.settings, "variants", "masks", "cameras"), *SECTIONS),
        )
        only = tables.get("only", self.only)
        if not isinstance(only, list | tuple) or not all(isinstance(name, str) for name in only):
            raise ConfigError("`only` must be a list of variants' names")
        config = replace(
            self,
            pipeline=pipeline,
            only=tuple(only),
            extra=self._with_variants(tables.get("variants", {})),
            masks=with_masks(self.masks, tables.get("masks", {})),
            **{
                name: override(getattr(self, name), tables.get(name, {}), name) for name in SECTIONS
            },
        )
        if "cameras" in tables:
            config = replace(config, cameras=_cameras(tables["cameras"]))
        return config

    def with_variants(self, variants: Iterable[Variant]) -> RunConfig:
        """Return the configuration with further variants; one of a name that is there replaces it.

        A `ConfigError` if a name is taken by something else.
        """
        extra = {variant.name: variant for variant in (*self.extra, *variants)}
        return replace(self, extra=tuple(extra.values()))

    def with_tuned(self, names: Iterable[str]) -> RunConfig:
        """Return the configuration with a variant for each named method that is tuned to a drive.

        A `ConfigError` if there is no such method, or it learns itself; see `tuned_variant`.
        """
        made = {
            variant.name: variant.pipeline for variant in variants_of(self.pipeline, self.extra)
        }
        masks = {*self.topics.masks, *self.masks}
        variants = []
        for name in names:
            if name not in made and name not in masks:
                known = either({*made, *masks} - {FILTERED, UNFILTERED})
                raise ConfigError(f"`tunes` {name}: there is no such method; choose {known}")
            variants.append(tuned_variant(name, made.get(name)))
        return self.with_variants(variants)

    def given(self) -> set[str]:
        """Return the names of the masks that the variants see."""
        used = (each.settings.get("given") for each in self.pipelines().values())
        return {own.name for own in used if own is not None}

    def for_training(self) -> RunConfig:
        """Return the configuration with the masks alone that variants learn from."""
        masks = {name: own for name, own in self.masks.items() if name in self.given()}
        return replace(self, masks=masks, only=())

    def of_drive(self, tables: Mapping[str, Any]) -> RunConfig:
        """Return the configuration with the tables of `OF_A_LOG` that hold for one drive.

        Labels replace the run's as a whole, the others key by key. A `ConfigError` for a table that
        holds for the whole run, or a value that cannot be used.
        """
        check_tables(tables, OF_A_LOG)
        labels = LabelSettings() if "labels" in tables else self.labels
        return replace(self, labels=labels).override(tables)

    def for_drive(self, path: str | os.PathLike[str]) -> RunConfig:
        """Return the configuration with the drive's name in the paths of masks and truth."""
        for own, each in self.masks.items():
            if not each.path:
                raise ConfigError(f"[masks.{own}] has no path: a folder, or LOG.mcap:/topic")
        only = {*self.masks, *self.topics.masks}
        if self.only:
            only &= {*self.only, *self.given()}
        masks = {own: in_drive(each, path) for own, each in self.masks.items() if own in only}
        topics = {own: topic for own, topic in self.topics.masks.items() if own in only}
        return replace(
            self,
            masks=masks,
            topics=replace(self.topics, masks=topics),
            truth=in_drive(self.truth, path),
        )

    def ignored(self) -> tuple[str, ...]:
        """Return a note for each setting of a variant's preset that the run does not follow."""
        return tuple(
            f"{variant.name}: preset {variant.preset} asks for {section}.{key} = {value}, but all "
            f"variants of a run are trained and scored alike ({getattr(own, key)})"
            for variant in self.extra
            for section in SECTIONS
            for key, value in PRESETS[variant.preset].get(section, {}).items()
            if getattr(own := getattr(self, section), key) != value
        )

    def as_dict(self) -> dict[str, Any]:
        """Return every effective setting as plain data, in the shape of a TOML file.

        A setting that is None has no value in such a file, and is left out there.
        """
        masks = {name: dataclasses.asdict(own) for name, own in self.masks.items()}
        return {
            "preset": self.preset,
            **({"only": list(self.only)} if self.only else {}),
            **self.pipeline.as_dict(),
            "variants": {
                each.name: {"preset": each.preset, **each.pipeline.as_dict()} for each in self.extra
            },
            **({"masks": masks} if masks else {}),
            **{name: dataclasses.asdict(getattr(self, name)) for name in SECTIONS},
            **({"cameras": [*map(dataclasses.asdict, self.cameras)]} if self.cameras else {}),
        }

    def _with_variants(self, tables: Any) -> tuple[Variant, ...]:
        if not isinstance(tables, Mapping):
            raise ConfigError("[variants] must hold a table for each variant")
        for name, own in tables.items():
            if not isinstance(own, Mapping):
                raise ConfigError(f"[variants.{name}] must be a table")
        made = [Variant.of(name, own, f"[variants.{name}]") for name, own in tables.items()]
        return self.with_variants(made).extra


def _cameras(entries: Any) -> tuple[CameraSettings, ...]:
    """Read ``[[cameras]]``, the topics of each; a `ConfigError` if one cannot be used."""
    if not isinstance(entries, list | tuple) or not all(isinstance(e, Mapping) for e in entries):
        raise ConfigError("cameras must be tables, each under [[cameras]]")
    if missing := [each for each in entries if not each.get("image")]:
        raise ConfigError(f"[[cameras]] {missing[0].get('name', '')}: image must name its topic")
    return tuple(override(CameraSettings(each["image"]), each, "cameras") for each in entries)


def configure(tables: Mapping[str, Any] | None = None, *, where: str = "") -> RunConfig:
    """Return the configuration of a preset with the values of some tables in place.

    Parameters
    ----------
    tables
        In the shape of a TOML file; ``preset`` names what they start from, ``paper`` by default.

    Raises
    ------
    ConfigError
        For a key or a value that cannot be used; names it, and what is allowed.

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

    A `ConfigError` if the file is missing, no TOML, or holds a key or a value that cannot be used.

    Parameters
    ----------
    path
        The file, in the shape that the top of this module describes.
    trusted
        Whether the user has named the file. One that came with results, or in a recording, loads
        no code.
    """
    return configure(read_tables(path, trusted=trusted), where=str(path))


WIDTH: Final = 100
_BOUNDS: Final = {
    "minimum": "at least {}",
    "exclusiveMinimum": "above {}",
    "maximum": "at most {}",
    "exclusiveMaximum": "below {}",
}
"""How a JSON schema's bounds are said."""


def run_toml(config: RunConfig, drive: str, version: str, command: str = "replay") -> str:
    """Write the TOML file that repeats a run, with every effective setting."""
    head = (
        f"# The configuration of a {command} of {visible(drive)} by roadeval {version}.\n"
        f"# To repeat the run, give this file to roadeval {command} as its configuration."
    )
    lines = [each for each in config_toml(config).splitlines() if each and each[0] != "#"]
    text = "\n".join(f"\n{each}" if each[0] == "[" else each for each in lines)
    return visible_lines(f"{head}\n{text}\n")


def _without_none(value: Any) -> Any:
    """Return plain data for TOML: without settings that are None, and with lists."""
    if isinstance(value, Mapping):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list | tuple) else value


def config_toml(config: RunConfig | None = None) -> str:
    """Return a configuration as TOML: every setting with its meaning, range and value.

    A setting without a value is a comment.

    Parameters
    ----------
    config
        The configuration; the defaults of ``roadeval replay`` otherwise. The text can be edited
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

    head = [f"preset = {tomlkit.item(config.preset).as_string()}", *_chain(config.pipeline)]
    if config.only:
        head += [*_comment("The variants that run."), _assignment("only", config.only)]
    parts = ["\n".join(head), *_stages(config.pipeline, "")]
    for variant in config.extra:
        named = tomlkit.item(variant.preset).as_string()
        parts.append(f"[variants.{variant.name}]\npreset = {named}")
        parts[-1] += "\n" + "\n".join(_chain(variant.pipeline))
        parts += _stages(variant.pipeline, f"variants.{variant.name}.")
    parts += [_table(f"masks.{name}", own) for name, own in config.masks.items()]
    parts += [_table(name, getattr(config, name)) for name in SECTIONS]
    cameras = [_without_none(dataclasses.asdict(each)) for each in config.cameras]
    parts += [tomlkit.dumps({"cameras": [each]}).strip() for each in cameras]
    return "\n\n".join(parts) + "\n"


def _chain(pipeline: Pipeline) -> Iterator[str]:
    yield from _comment(f"The stages in the order they run; there are {', '.join(stages.names())}.")
    yield f"chain = [{', '.join(f'{name!r}' for name in pipeline.chain)}]".replace("'", '"')


def _stages(pipeline: Pipeline, prefix: str) -> list[str]:
    return [_table(f"{prefix}{name}", own) for name, own in pipeline.settings.items()]


def _table(name: str, settings: Any) -> str:
    """Write the table of a settings dataclass; dataclasses in it follow as tables."""
    title, comments = _comments(settings.__class__)
    lines, inner = [*title, f"[{name}]"], []
    for each in dataclasses.fields(settings):
        value = getattr(settings, each.name)
        if dataclasses.is_dataclass(value):
            inner.append(_table(f"{name}.{each.name}", value))
            continue
        lines += ["", *comments[each.name], _assignment(each.name, value)]
    return "\n\n".join(["\n".join(lines), *inner])


@cache
def _comments(kind: type) -> tuple[list[str], dict[str, list[str]]]:
    """Return the comments of a settings dataclass, and of each setting: meaning and range."""
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
    """Describe the allowed values of a setting by its JSON schema; empty where all are allowed."""
    for each in (schema, *schema.get("anyOf", ())):
        if "enum" in each:
            return f"One of {', '.join(map(str, each['enum']))}."
        bounds = [text.format(each[name]) for name, text in _BOUNDS.items() if name in each]
        if bounds:
            return f"{', '.join(bounds).capitalize()}."
    return ""
