"""Variants: named pipelines that run side by side."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from roadeval.config.errors import ConfigError
from roadeval.config.names import check_variant_name
from roadeval.config.override import either, override
from roadeval.config.presets import PRESETS
from roadeval.config.settings import SECTIONS
from roadeval.data import ERRORS, FILTERED, FINAL_STAGE, UNFILTERED, VariantLayout
from roadeval.pipeline import stages
from roadeval.pipeline.chain import Pipeline


@dataclass(frozen=True, slots=True)
class Variant:
    """A name, a pipeline, and the preset that it started from."""

    name: str
    pipeline: Pipeline
    preset: str = "paper"

    @classmethod
    def of(cls, name: str, tables: Mapping[str, Any], where: str = "") -> Variant:
        """Make a variant from tables in the shape of a TOML file: ``preset``, ``chain``, stages.

        Raises
        ------
        ConfigError
            For a key or a value that cannot be used. ``where`` begins the message.
        """
        preset = preset_of(tables, "paper", where)
        rest = {key: value for key, value in tables.items() if key != "preset"}
        base = pipeline_of(None, PRESETS[preset], where)
        for section in SECTIONS:
            if section in rest:
                raise ConfigError(
                    f"{_prefix(where)}[{section}] holds for the whole run: it belongs in the "
                    "configuration of the run"
                )
        pipeline = pipeline_of(base, rest, where)
        check_tables(rest, ("chain", *pipeline.settings), where)
        return cls(name, pipeline, preset)

    def layout(self) -> VariantLayout:
        """Describe the variant as recording and tables need to know it beforehand."""
        return VariantLayout(
            self.name, self._title(), self.pipeline.masks(), self.pipeline.layers()
        )

    def _title(self) -> str:
        """Return in a few words what tells the variant from others."""
        found = self.pipeline.stages()
        if filters := [stage.title for stage in found if stage.is_filter]:
            return f"with {', '.join(filters)}"
        if any(stage.fit is not None and stage.name in stages.STAGES for stage in found):
            return "without the filter"
        return ", ".join(stage.title for stage in found if stage.name != FINAL_STAGE)


def variants_of(pipeline: Pipeline, extra: Iterable[Variant]) -> tuple[Variant, ...]:
    """Return a run's variants: with the pipeline's filters, without them, and the extra ones.

    A pipeline without a filter gives the unfiltered variant alone.

    Raises
    ------
    ConfigError
        If an extra variant's name is taken, reserved, or no plain word.
    """
    variants = [Variant(FILTERED, pipeline)] if pipeline.has_filter else []
    variants.append(Variant(UNFILTERED, pipeline.without_filter()))
    for variant in extra:
        check_variant_name(variant.name, {v.name for v in variants})
        variants.append(variant)
    return tuple(variants)


def preset_of(tables: Mapping[str, Any], default: str, where: str) -> str:
    """Return the name of the preset that tables start from; a `ConfigError` if there is none."""
    name = tables.get("preset", default)
    if not isinstance(name, str) or name not in PRESETS:
        raise ConfigError(f"{_prefix(where)}preset: there is no {name!r}; choose {either(PRESETS)}")
    return name


def check_tables(tables: Mapping[str, Any], known: Collection[str], where: str) -> None:
    """Refuse, as a `ConfigError`, a table or key at the top that is not known."""
    for key in tables:
        if key not in known:
            names = either(name for name in known if name != "chain")
            if isinstance(tables[key], Mapping):
                raise ConfigError(f"{_prefix(where)}[{key}] is no table here; choose {names}")
            raise ConfigError(
                f"{_prefix(where)}{key} stands in no table; put it below one of {names}"
            )


def pipeline_of(base: Pipeline | None, tables: Mapping[str, Any], where: str) -> Pipeline:
    """Override a pipeline's chain and its stages' settings by tables in the shape of a TOML file.

    Raises
    ------
    ConfigError
        For a chain that cannot run, or a setting that cannot be used.
    """
    chain = _chain(tables.get("chain", base.chain if base else ()), where)
    current = {} if base is None else base.settings
    settings = {
        each.name: override(current.get(each.name) or each.settings(), tables, each.name, where)
        for each in stages.stages_of(chain)
    }
    pipeline = Pipeline(chain, settings)
    layers = [spec.name for spec in (*pipeline.layers(), ERRORS)]
    for name in layers:
        if layers.count(name) > 1:
            raise ConfigError(f"{_prefix(where)}chain: two layers are called {name}")
    return pipeline


def _chain(names: Any, where: str) -> tuple[str, ...]:
    """Check a chain: known stages, each once, one mask of a name, and the final one last."""
    begin = f"{_prefix(where)}chain"
    if not isinstance(names, list | tuple) or not names:
        raise ConfigError(f"{begin} must be a list of stages; choose {either(stages.names())}")
    for name in names:
        if not isinstance(name, str):
            choice = either(stages.names())
            raise ConfigError(f"{begin}: there is no stage {name!r}; choose {choice}")
    try:
        found = stages.stages_of(names)
    except stages.UnknownStageError as error:
        raise ConfigError(f"{begin}: {error}") from error
    if len({stage.name for stage in found}) < len(found):
        raise ConfigError(f"{begin}: a stage can occur only once")
    masks = [stage.reported for stage in found if stage.yields_mask]
    if len(set(masks)) < len(masks):
        twice = next(mask for mask in masks if masks.count(mask) > 1)
        both = [stage.name for stage in found if stage.reported == twice]
        raise ConfigError(f"{begin}: {' and '.join(both)} both make the mask {twice}")
    if names[-1] != FINAL_STAGE:
        raise ConfigError(f"{begin} must end with {FINAL_STAGE}, whose mask is the answer")
    return tuple(names)


def _prefix(where: str) -> str:
    return f"{where}: " if where else ""
