"""Variants, which are named methods that run side by side, and presets of their settings.

A variant is a pipeline, a network, or the masks of another method.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from roadeval.config.settings import SECTIONS
from roadeval.config.tables import ConfigError, in_file, list_names, override, read_tables
from roadeval.data import (
    ERRORS,
    FILTERED,
    FINAL_STAGE,
    RESERVED,
    TUNED,
    UNFILTERED,
    VariantLayout,
    is_plain,
)
from roadeval.logs.settings import LabelPlace, MaskSettings
from roadeval.pipeline import stages
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import Stage
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import likely

PAPER_CHAIN: Final = ("shadow", "similarity", "svm", "post")

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
    "printed_order": {"chain": PAPER_CHAIN, "post": {"operations": ("close", "open")}},
    "hsi": {"chain": PAPER_CHAIN, "shadow": {"colour_space": "hsi"}},
    "gated": {"chain": ("exposure", "gated", "similarity", "svm", "post")},
    "robust": {
        "chain": ("exposure", "trees", "post"),
        "training": {"pixels_per_class": 1000, "max_pixels": 50_000},
        "post": {"region": "all"},
    },
}
"""Presets by name, each in the shape of a TOML file (see `roadeval.config.run`).

``printed_order`` and ``hsi`` are ``paper`` with one detail as it is printed: the order of
post-processing (section 4.4), and the colour space of the compensation (section 4.2, step 5). As
variants beside ``paper`` they show the effect of that detail.

In ``gated`` exposure comes before the filter, which is then better on four of five drives. The
variant ``unfiltered`` shows the effect of exposure alone.

``robust`` keeps every region of its mask, as vehicles divide a road into pieces.
"""
LONGEST: Final = 64
"""Greatest length of a variant's name, which is printed in the columns of tables."""
DRIVE: Final = "{drive}"
"""The placeholder of the drive's name in the path of labels."""
AS_IT_IS: Final[Mapping[str, Any]] = {"operations": (), "region": "all", "fill": False}
"""Settings of phase 4 that leave a mask as it is."""

Place = TypeVar("Place", bound=LabelPlace)
Masks = Mapping[str, MaskSettings]
"""Settings of masks in files, by the variant's name."""


@dataclass(frozen=True)
class Variant:
    """A named method: its pipeline, and the preset that its settings change."""

    name: str
    pipeline: Pipeline
    preset: str = "paper"
    of_pair: bool = False
    """Whether it is the run's pipeline without its filter, beside the one with the filter."""

    @classmethod
    def of(cls, name: str, tables: Mapping[str, Any], where: str = "") -> Variant:
        """Make a variant from tables in the shape of a TOML file: ``preset``, ``chain``, stages.

        A `ConfigError`, which names the place ``where``, for a key or a value that cannot be used.
        """
        with in_file(where):
            preset = preset_of(tables)
            tables = {key: value for key, value in tables.items() if key != "preset"}
            for section in SECTIONS:
                if section in tables:
                    problem = f"[{section}] applies to all variants"
                    raise ConfigError(problem, remedy="set it in the run's configuration")
            pipeline = pipeline_of(pipeline_of(None, PRESETS[preset]), tables)
            check_tables(tables, ("chain", *pipeline.settings))
        return cls(name, pipeline, preset)

    def layout(self) -> VariantLayout:
        """Return the layout, which recording and tables need before the first frame."""
        stages_ = self.pipeline.stages()
        title = ", ".join(stage.title for stage in stages_ if stage.name != FINAL_STAGE)
        if any(stage.is_filter for stage in stages_):
            title = "with the filter"
        elif self.of_pair:
            title = "without the filter"
        return VariantLayout(self.name, title, self.pipeline.masks(), self.pipeline.layers())


def variants_of(
    pipeline: Pipeline, extra: Iterable[Variant], preset: str = "paper"
) -> tuple[Variant, ...]:
    """Return the variants of a run: with the pipeline's filters, without them, and the extra ones.

    A pipeline without a filter gives one variant: ``unfiltered``, or the name of the preset if the
    preset has no filter either. A `ConfigError` if the name of an extra variant is taken, reserved,
    or not plain.
    """
    unfiltered = pipeline.without_filter()
    has_filter = unfiltered != pipeline
    variants = [Variant(FILTERED, pipeline)] if has_filter else []
    filters = [stage.is_filter for stage in _stages_of(PRESETS[preset]["chain"])]
    name = UNFILTERED if has_filter or any(filters) else preset
    variants.append(Variant(name, unfiltered, of_pair=has_filter))
    for variant in extra:
        check_variant_name(variant.name, {other.name for other in variants})
        variants.append(variant)
    return tuple(variants)


def preset_of(tables: Mapping[str, Any]) -> str:
    """Return the name of the preset of some tables; a `ConfigError` if there is no such preset."""
    name = tables.get("preset", "paper")
    if not isinstance(name, str) or name not in PRESETS:
        remedy = f"{likely(str(name), PRESETS)}choose {list_names(PRESETS)}"
        raise ConfigError(f"there is no {name!r}", where="preset", remedy=remedy)
    return name


def check_tables(tables: Mapping[str, Any], allowed: Collection[str]) -> None:
    """Raise a `ConfigError` for a table, or a key outside of tables, that is not allowed."""
    names = list_names(name for name in allowed if name != "chain")
    for key, table in tables.items():
        if key in allowed:
            continue
        if isinstance(table, Mapping):
            meant = likely(key, allowed)
            raise ConfigError(f"[{key}] is not a table here", remedy=f"{meant}choose {names}")
        raise ConfigError(f"{key} is in no table", remedy=f"put it below one of {names}")


def pipeline_of(base: Pipeline | None, tables: Mapping[str, Any]) -> Pipeline:
    """Return a pipeline with the chain and the settings of tables in the shape of a TOML file.

    A `ConfigError` for a chain that cannot run, or a setting that cannot be used.
    """
    chain = tables.get("chain", base.chain if base else ())
    defaults = {} if base is None else base.settings
    settings = {
        stage.name: override(
            defaults.get(stage.name) or stage.settings(), tables.get(stage.name, {}), stage.name
        )
        for stage in _stages_of(chain)
    }
    pipeline = Pipeline(tuple(chain), settings)
    for stage in pipeline.heard_stages():
        if stage.fit is not None:
            problem = f"{stage.name} is trained; a later stage cannot train on its output"
            raise ConfigError(problem, where="chain")
    layers = [spec.name for spec in (*pipeline.layers(), ERRORS)]
    for name in layers:
        if layers.count(name) > 1:
            raise ConfigError(f"two layers are called {name}", where="chain")
    return pipeline


def _stages_of(chain: Any) -> tuple[Stage, ...]:
    """Return the stages of a chain; a `ConfigError` if it is not valid."""
    choice = f"choose {list_names(stages.names())}"
    if not isinstance(chain, list | tuple) or not chain:
        raise ConfigError("chain must be a list of stages", remedy=choice)
    for name in chain:
        if not isinstance(name, str):
            raise ConfigError(f"there is no stage {name!r}", where="chain", remedy=choice)
    try:
        chain_stages = stages.stages_of(chain)
    except stages.UnknownStageError as error:
        raise ConfigError.of(error, "chain") from error
    if len({stage.name for stage in chain_stages}) < len(chain_stages):
        raise ConfigError("a stage can occur only once", where="chain")
    if chain[-1] != FINAL_STAGE:
        raise ConfigError(f"chain must end with {FINAL_STAGE}, which makes the final mask")
    return tuple(chain_stages)


def check_variant_name(name: str, taken: Collection[str]) -> None:
    """Raise a `ConfigError` for a variant's name that results cannot hold, or that is taken.

    A spreadsheet takes a cell that begins with ``-`` for a formula, and Matplotlib leaves a name
    that begins with ``_`` out of a legend.
    """
    where = f"variant {name!r}" if len(name) <= LONGEST else f"variant {name[:LONGEST] + '...'!r}"
    if not is_plain(name) or name[0] in "-_" or len(name) > LONGEST:
        raise ConfigError(
            "a name is made of letters, digits, '-' and '_', begins with a letter or a digit, and "
            f"has at most {LONGEST} characters",
            where=where,
        )
    if name in RESERVED:
        raise ConfigError(f"the name is reserved ({list_names(RESERVED)})", where=where)
    if name in taken:
        raise ConfigError("the name is taken", where=where, remedy="choose another")


def network_variant(name: str, path: str) -> Variant:
    """Return the variant of a network; phase 4 does not change its mask.

    ``path`` is a network, or a TOML file with the settings of the stage ``net``. In that file
    ``file`` is relative to the TOML file's folder, and ``[post]`` switches on post-processing. The
    network itself is opened when it is run. A `ConfigError` if a TOML file cannot be used.
    """
    settings: dict[str, Any] = {"file": path}
    if is_toml := Path(path).suffix == ".toml":
        settings = read_tables(path)
    post = settings.pop("post", {})
    chain = ["net", FINAL_STAGE]
    if settings.get("decide") == TRAINED:
        if "threshold" in settings:
            problem = f'threshold has no effect if decide = "{TRAINED}"'
            raise ConfigError(problem, where=path, remedy="remove one of the two")
        del settings["decide"]
        chain.insert(1, "threshold")
    if not isinstance(file := settings.get("file"), str) or not file:
        raise ConfigError("file must name the network, an ONNX file", where=path)
    if not isinstance(post, Mapping):
        raise ConfigError("[post] must be a table", where=path)
    if is_toml:
        settings["file"] = str(Path(path).parent / file)
    tables = {"chain": chain, "net": settings, "post": {**AS_IT_IS, **post}}
    return Variant.of(name, tables, path if is_toml else "")


def thresholded_variant(name: str) -> Variant:
    """Return the variant that thresholds a method's confidences; training frames set the limit."""
    chain = ("given", "threshold", FINAL_STAGE)
    return Variant.of(name, {"chain": chain, "given": {"name": name}, "post": AS_IT_IS})


TRAINED: Final = "trained"
"""The value of ``decide`` with which the training frames choose the threshold."""


def tuned_variant(name: str, method: Pipeline | None) -> Variant:
    """Return the variant that learns to correct a method.

    It has the preset ``robust``, and the method's output is a feature of its trees. ``method`` is
    None if another system made the masks. A `ConfigError` if the method is trained itself, because
    its output on its training frames is over-confident.
    """
    before: tuple[str, ...] = ("given",)
    settings = {"given": {"name": name}}
    if method is not None:
        if learning := [stage for stage in method.learning_stages() if stage != "threshold"]:
            raise ConfigError(
                f"{name} is trained itself ({', '.join(learning)}), so its output on its training "
                "frames is over-confident",
                setting="tunes",
            )
        dropped = ("threshold", FINAL_STAGE)
        before = tuple(stage for stage in method.chain if stage not in dropped)
        settings = {s: asdict(values) for s, values in method.settings.items() if s not in dropped}
    exposure = () if "exposure" in before else ("exposure",)
    chain = (*before, *exposure, "trees", FINAL_STAGE)
    tables = {"preset": "robust", "chain": chain, **settings, "trees": {"opinion": True}}
    return Variant.of(f"{name}{TUNED}", tables, Sentence("{tunes} {}", name))


def with_masks(current: Masks, tables: Any) -> Masks:
    """Return the settings of masks, changed by tables of further settings by name.

    A `ConfigError` for a key or a value that cannot be used.
    """
    if not isinstance(tables, Mapping):
        raise ConfigError("[masks] must hold a table for each variant")
    masks = dict(current)
    for name, table in tables.items():
        masks[name] = override(masks.get(name, MaskSettings()), table, f"masks.{name}")
    return masks


def in_drive(place: Place, drive: str | os.PathLike[str]) -> Place:
    """Return the place of labels; in its paths `DRIVE` is replaced by the drive's name.

    The name is that of the drive's folder, or of its file without the ending.
    """
    path = Path(drive)
    name = path.name if path.is_dir() else path.stem
    images = place.images and place.images.replace(DRIVE, name)
    return replace(place, path=place.path.replace(DRIVE, name), images=images)
