"""One validated, frozen configuration: a chain of stages, the settings of each, and the rest.

A TOML file names a preset and overrides what it wants::

    preset = "paper"

    [shadow]
    ring_width = 3
    max_gain = 4.0

    [training]
    frames = 20
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from roadeval.data import FILTERED, FINAL_STAGE, RESERVED, UNFILTERED, VariantLayout
from roadeval.errors import RoadevalError
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.pipeline.chain import STAGES, Chain, Pipeline
from roadeval.training import TrainingSettings


class ConfigError(RoadevalError):
    """A setting that cannot be used: which file, which key, and what is allowed."""


PAPER_CHAIN: Final = ("shadow", "similarity", "svm", "post")


@dataclass(frozen=True, slots=True)
class Config:
    """What a variant does, and how it is trained and scored.

    Parameters
    ----------
    preset
        The preset it started from.
    chain
        Names of the stages, in the order they run.
    stages
        The settings of each stage, by name.
    training, evaluation
        The settings of the two rooms.
    """

    preset: str = "paper"
    chain: tuple[str, ...] = PAPER_CHAIN
    stages: Mapping[str, Any] = field(
        default_factory=lambda: Pipeline.default(PAPER_CHAIN).settings
    )
    training: TrainingSettings = field(default_factory=TrainingSettings)
    evaluation: EvaluationSettings = field(default_factory=EvaluationSettings)

    @property
    def has_filter(self) -> bool:
        """Whether some stage of the chain is a filter."""
        return self.pipeline.has_filter

    def without_filter(self) -> Config:
        """Give the same configuration with the filters taken out of its chain."""
        pipeline = self.pipeline.without_filter()
        return replace(self, chain=pipeline.chain, stages=pipeline.settings)

    @property
    def pipeline(self) -> Pipeline:
        """The stages and their settings."""
        return Pipeline(self.chain, self.stages)

    def bind(self, parameters: Mapping[str, Any]) -> Chain:
        """Return the chain that runs with what its stages have learnt, by stage."""
        return self.pipeline.bind(parameters)

    def as_dict(self) -> dict[str, Any]:
        """Give every effective setting as plain data, in the shape of a TOML file."""
        return {
            "preset": self.preset,
            "chain": list(self.chain),
            **{name: dataclasses.asdict(self.stages[name]) for name in self.chain},
            "training": dataclasses.asdict(self.training),
            "evaluation": dataclasses.asdict(self.evaluation),
        }


PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "paper": {"chain": PAPER_CHAIN},
    "printed": {
        "chain": PAPER_CHAIN,
        "shadow": {
            "threshold": "printed",
            "inclusive": True,
            "statistic": "printed",
            "colour_space": "hsi",
        },
        "svm": {"kernel": "linear"},
        "post": {"operations": ("close", "open")},
    },
    "gated": {"chain": ("gated", "similarity", "svm", "post")},
    "robust": {
        "chain": ("exposure", "similarity", "context", "post"),
        "training": {"pixels_per_class": 800, "max_pixels": 20_000},
    },
}
"""The presets, as overrides of the settings' own defaults."""


def preset(name: str) -> Config:
    """Give a preset by name.

    Raises
    ------
    ConfigError
        If there is none of this name; lists those that exist.
    """
    if name not in PRESETS:
        raise ConfigError(f"there is no preset {name!r}; choose {_either(PRESETS)}")
    return _apply(Config(preset=name), PRESETS[name], f"preset {name}")


def load_config(path: Path, base: str | None = None) -> Config:
    """Read a TOML configuration.

    Parameters
    ----------
    path
        The file. Its ``preset`` key names what it starts from.
    base
        The preset to start from where the file names none; ``paper`` otherwise.

    Raises
    ------
    ConfigError
        If the file is missing, no TOML, or holds a key or a value that cannot be used.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: there is no such configuration file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from error
    name = tables.pop("preset", base or "paper")
    if not isinstance(name, str) or name not in PRESETS:
        raise ConfigError(f"{path}: preset: there is no {name!r}; choose {_either(PRESETS)}")
    return _apply(preset(name), tables, str(path))


def _apply(config: Config, tables: Mapping[str, Any], where: str) -> Config:
    chain = _chain(tables.get("chain", config.chain), where)
    known = (*chain, "training", "evaluation")
    for key in tables:
        if key not in (*known, "chain"):
            raise ConfigError(f"{where}: [{key}] is no table here; choose {_either(known)}")
    current = {name: config.stages.get(name) or STAGES[name].settings() for name in chain}
    return replace(
        config,
        chain=chain,
        stages={n: override(current[n], tables.get(n, {}), f"{where}: [{n}]") for n in chain},
        training=override(config.training, tables.get("training", {}), f"{where}: [training]"),
        evaluation=override(
            config.evaluation, tables.get("evaluation", {}), f"{where}: [evaluation]"
        ),
    )


def _chain(names: Any, where: str) -> tuple[str, ...]:
    if not isinstance(names, list | tuple) or not names:
        raise ConfigError(f"{where}: chain must be a list of stages; choose {_either(STAGES)}")
    for name in names:
        if name not in STAGES:
            raise ConfigError(
                f"{where}: chain: there is no stage {name!r}; choose {_either(STAGES)}"
            )
    if len(set(names)) < len(names):
        raise ConfigError(f"{where}: chain: a stage can occur only once")
    masks = Pipeline(tuple(names), {}).masks()
    if len(set(masks)) < len(masks):
        twice = next(mask for mask in masks if masks.count(mask) > 1)
        both = [name for name in names if STAGES[name].reported == twice]
        raise ConfigError(f"{where}: chain: {' and '.join(both)} both make the mask {twice}")
    if names[-1] != FINAL_STAGE:
        raise ConfigError(f"{where}: chain must end with {FINAL_STAGE}, whose mask is the answer")
    return tuple(names)


def override(settings: Any, values: Any, where: str) -> Any:
    """Give a settings dataclass with some of its values replaced, and validated as a whole.

    Raises
    ------
    ConfigError
        For an unknown key or a value out of range; names the key.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where} must be a table")
    merged = _merge(dataclasses.asdict(settings), values)
    try:
        return type(settings)(**merged)
    except ValidationError as error:
        raise ConfigError(f"{where} {_first(error, settings)}") from error


def _merge(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in values.items():
        inner = merged.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[key] = _merge(inner, value)
        else:
            merged[key] = value
    return merged


def _first(error: ValidationError, settings: Any) -> str:
    """Say in one line what is wrong with the first bad key."""
    problem = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in problem["loc"]) or "settings"
    if problem["type"] == "unexpected_keyword_argument":
        names = [entry.name for entry in dataclasses.fields(settings)]
        return f"{key}: there is no such setting; choose {_either(names)}"
    message = problem["msg"].removeprefix("Value error, ")
    given = problem["input"]
    shown = "" if isinstance(given, Mapping) else f" (given: {given!r})"
    return f"{key}: {message[0].lower()}{message[1:]}{shown}"


def _either(names: Any) -> str:
    return ", ".join(sorted(names))


# --- Variants -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Variant:
    """A name and a configuration; with a model's parameters it can run."""

    name: str
    config: Config

    def layout(self) -> VariantLayout:
        """Describe the variant as recording and tables need to know it beforehand."""
        titles = [STAGES[n].title for n in self.config.chain if STAGES[n].is_filter]
        return VariantLayout(
            self.name,
            f"with {', '.join(titles)}" if titles else "without the filter",
            self.config.pipeline.masks(),
            self.config.pipeline.layers(),
        )


def pipelines_of(variants: Iterable[Variant]) -> dict[str, Pipeline]:
    """Return each variant's stages and settings, by the variant's name."""
    return {variant.name: variant.config.pipeline for variant in variants}


def variants_of(config: Config, extra: Mapping[str, Config]) -> tuple[Variant, ...]:
    """Give the variants of a run: with the chain's filters, without them, and the extra ones.

    A chain without a filter gives the unfiltered variant alone.

    Raises
    ------
    ConfigError
        If an extra variant's name is taken, reserved, or no plain word.
    """
    variants = [Variant(FILTERED, config)] if config.has_filter else []
    variants.append(Variant(UNFILTERED, config.without_filter()))
    for name, other in extra.items():
        check_variant_name(name, {v.name for v in variants})
        variants.append(Variant(name, other))
    return tuple(variants)


def check_variant_name(name: str, taken: set[str]) -> None:
    """Refuse, as a `ConfigError`, a variant's name that an entity path cannot bear."""
    if not name.replace("_", "").replace("-", "").isalnum() or not name.isascii():
        raise ConfigError(f"variant {name!r}: a name is made of letters, digits, '-' and '_' alone")
    if name in RESERVED:
        raise ConfigError(f"variant {name!r}: the name is reserved ({_either(RESERVED)})")
    if name in taken:
        raise ConfigError(f"variant {name!r}: the name is taken; choose another")
