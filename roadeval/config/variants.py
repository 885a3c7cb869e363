"""Variants, which are named methods that run side by side, and the presets that they start from.

A variant is a pipeline, a network, or the masks of another method.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from roadeval.config.settings import SECTIONS
from roadeval.config.tables import ConfigError, either, in_file, override, read_tables
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
"""By name, each in the shape of a TOML file (see `roadeval.config.run`).

``printed_order`` and ``hsi`` are ``paper`` with one thing as the text has it: the order of
post-processing (section 4.4), and the colour space of the compensation (section 4.2, step 5). They
show beside it, as variants, what that thing does.

In ``gated`` exposure comes before the filter, which is then better on four of five drives. The
variant ``unfiltered`` shows what exposure alone does.

``robust`` keeps every region of its mask: vehicles cut a road in pieces.
"""
LONGEST: Final = 64
"""Letters of a variant's name: it is printed in the columns of tables."""
DRIVE: Final = "{drive}"
"""The placeholder of the drive's name in a path of masks."""
AS_IT_IS: Final[Mapping[str, Any]] = {"operations": (), "region": "all", "fill": False}
"""Settings of phase 4 that leave a mask as it is."""

Place = TypeVar("Place", bound=LabelPlace)
Masks = Mapping[str, MaskSettings]
"""Settings of masks in files, by the variant's name."""


@dataclass(frozen=True)
class Variant:
    """A named method: its pipeline, and the preset that it started from."""

    name: str
    pipeline: Pipeline
    preset: str = "paper"
    of_pair: bool = False
    """Whether it is a pipeline whose filter was taken out, beside the one that has it."""

    @classmethod
    def of(cls, name: str, tables: Mapping[str, Any], where: str = "") -> Variant:
        """Make a variant from tables in the shape of a TOML file: ``preset``, ``chain``, stages.

        A `ConfigError` for a key or a value that cannot be used; ``where`` begins its message.
        """
        with in_file(where):
            preset = preset_of(tables)
            rest = {key: value for key, value in tables.items() if key != "preset"}
            for section in SECTIONS:
                if section in rest:
                    raise ConfigError(
                        f"[{section}] holds for the whole run: it belongs in the configuration of "
                        "the run"
                    )
            pipeline = pipeline_of(pipeline_of(None, PRESETS[preset]), rest)
            check_tables(rest, ("chain", *pipeline.settings))
        return cls(name, pipeline, preset)

    def layout(self) -> VariantLayout:
        """Return the layout of the variant, which recording and tables need beforehand."""
        found = self.pipeline.stages()
        title = ", ".join(stage.title for stage in found if stage.name != FINAL_STAGE)
        if any(stage.is_filter for stage in found):
            title = "with the filter"
        elif self.of_pair:
            title = "without the filter"
        return VariantLayout(self.name, title, self.pipeline.masks(), self.pipeline.layers())


def variants_of(pipeline: Pipeline, extra: Iterable[Variant]) -> tuple[Variant, ...]:
    """Return a run's variants: with the pipeline's filters, without them, and the extra ones.

    A pipeline without a filter gives the unfiltered variant alone. A `ConfigError` if an extra
    variant's name is taken, reserved, or no plain word.
    """
    unfiltered = pipeline.without_filter()
    pair = unfiltered != pipeline
    variants = [Variant(FILTERED, pipeline)] if pair else []
    variants.append(Variant(UNFILTERED, unfiltered, of_pair=pair))
    for variant in extra:
        check_variant_name(variant.name, {v.name for v in variants})
        variants.append(variant)
    return tuple(variants)


def preset_of(tables: Mapping[str, Any]) -> str:
    """Return the name of the preset that tables start from; a `ConfigError` if there is none."""
    name = tables.get("preset", "paper")
    if not isinstance(name, str) or name not in PRESETS:
        raise ConfigError(f"preset: there is no {name!r}; choose {either(PRESETS)}")
    return name


def check_tables(tables: Mapping[str, Any], known: Collection[str]) -> None:
    """Raise a `ConfigError` for a table or key at the top that is not known."""
    for key in tables:
        if key not in known:
            names = either(name for name in known if name != "chain")
            if isinstance(tables[key], Mapping):
                raise ConfigError(f"[{key}] is no table here; choose {names}")
            raise ConfigError(f"{key} is in no table; put it below one of {names}")


def pipeline_of(base: Pipeline | None, tables: Mapping[str, Any]) -> Pipeline:
    """Override a pipeline's chain and its stages' settings by tables in the shape of a TOML file.

    A `ConfigError` for a chain that cannot run, or a setting that cannot be used.
    """
    chain = _chain(tables.get("chain", base.chain if base else ()))
    current = {} if base is None else base.settings
    settings = {
        each.name: override(
            current.get(each.name) or each.settings(), tables.get(each.name, {}), each.name
        )
        for each in stages.stages_of(chain)
    }
    pipeline = Pipeline(chain, settings)
    for stage in pipeline.heard():
        if stage.fit is not None:
            raise ConfigError(f"chain: {stage.name} learns, so no later stage can learn from it")
    layers = [spec.name for spec in (*pipeline.layers(), ERRORS)]
    for name in layers:
        if layers.count(name) > 1:
            raise ConfigError(f"chain: two layers are called {name}")
    return pipeline


def _chain(names: Any) -> tuple[str, ...]:
    """Check a chain: known stages, each once, and the final one last."""
    if not isinstance(names, list | tuple) or not names:
        raise ConfigError(f"chain must be a list of stages; choose {either(stages.names())}")
    for name in names:
        if not isinstance(name, str):
            choice = either(stages.names())
            raise ConfigError(f"chain: there is no stage {name!r}; choose {choice}")
    try:
        found = stages.stages_of(names)
    except stages.UnknownStageError as error:
        raise ConfigError(f"chain: {error}") from error
    if len({stage.name for stage in found}) < len(found):
        raise ConfigError("chain: a stage can occur only once")
    if names[-1] != FINAL_STAGE:
        raise ConfigError(f"chain must end with {FINAL_STAGE}, whose mask is the answer")
    return tuple(names)


def check_variant_name(name: str, taken: Collection[str]) -> None:
    """Raise a `ConfigError` for a variant's name that results cannot hold, or that is taken.

    A spreadsheet takes a cell that begins with ``-`` for a formula, and Matplotlib leaves
    names that begin with ``_`` out of a legend.
    """
    if not is_plain(name) or name[0] in "-_" or len(name) > LONGEST:
        shown = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        raise ConfigError(
            f"variant {shown!r}: a name is made of letters, digits, '-' and '_' alone, begins with "
            f"a letter or a digit, and has at most {LONGEST} of them"
        )
    if name in RESERVED:
        raise ConfigError(f"variant {name!r}: the name is reserved ({either(RESERVED)})")
    if name in taken:
        raise ConfigError(f"variant {name!r}: the name is taken; choose another")


def network_variant(name: str, path: str) -> Variant:
    """Return the variant of a network: its mask, which phase 4 leaves as it is.

    A `ConfigError` if a TOML file cannot be used. The network itself is opened when it is run.
    ``path`` is an ONNX file, or a TOML file with the settings of the stage ``net``, whose ``file``
    is found from the folder of the TOML file. Its table ``[post]`` asks for post-processing.
    """
    tables: Mapping[str, Any] = {"file": path}
    if in_a_file := Path(path).suffix == ".toml":
        tables = read_tables(path)
    settings = {key: value for key, value in tables.items() if key != "post"}
    is_trained = settings.get("decide") == TRAINED
    if is_trained:
        if "threshold" in settings:
            raise ConfigError(f'{path}: threshold says nothing where decide = "{TRAINED}"')
        del settings["decide"]
    file, post = settings.get("file"), tables.get("post", {})
    if not isinstance(file, str) or not file:
        raise ConfigError(f"{path}: file must name the network, an ONNX file")
    if not isinstance(post, Mapping):
        raise ConfigError(f"{path}: [post] must be a table")
    if in_a_file:
        settings["file"] = str(Path(path).parent / file)
    stages_ = ("net", *(("threshold",) if is_trained else ()), FINAL_STAGE)
    chain = {"chain": stages_, "net": settings, "post": {**AS_IT_IS, **post}}
    return Variant.of(name, chain, path if in_a_file else "")


def thresholded(name: str) -> Variant:
    """Return the variant of another method's confidences, above the training frames' threshold."""
    chain = {"chain": ("given", "threshold", FINAL_STAGE), "given": {"name": name}}
    return Variant.of(name, {**chain, "post": AS_IT_IS})


TRAINED: Final = "trained"
"""The value of ``decide`` with which the training frames choose the threshold."""


def tuned_variant(name: str, method: Pipeline | None) -> Variant:
    """Return the variant that corrects a method by what training frames teach.

    It is the preset ``robust`` with what the method says of a pixel among the features of its
    trees. ``method`` is None for one whose masks another system has made. A `ConfigError` if the
    method learns, for of frames that taught it, it would say too much.
    """
    before: tuple[str, ...] = ("given",)
    settings = {"given": {"name": name}}
    if method is not None:
        if learning := [name for name in method.learning() if name != "threshold"]:
            raise ConfigError(
                f"`tunes` {name}: it learns itself ({', '.join(learning)}), and of frames that "
                "taught it, it says too much to learn from"
            )
        dropped = ("threshold", FINAL_STAGE)
        before = tuple(each for each in method.chain if each not in dropped)
        settings = {k: asdict(own) for k, own in method.settings.items() if k not in dropped}
    exposure = () if "exposure" in before else ("exposure",)
    chain = (*before, *exposure, "trees", FINAL_STAGE)
    tables = {"preset": "robust", "chain": chain, **settings, "trees": {"opinion": True}}
    return Variant.of(f"{name}{TUNED}", tables, f"`tunes` {name}")


def with_masks(current: Masks, tables: Any) -> Masks:
    """Return settings of masks with those of further tables: key by key where the name is there.

    A `ConfigError` for a key or a value that cannot be used.
    """
    if not isinstance(tables, Mapping):
        raise ConfigError("[masks] must hold a table for each variant")
    return {
        **current,
        **{
            name: override(current.get(name, MaskSettings()), own, f"masks.{name}")
            for name, own in tables.items()
        },
    }


def in_drive(place: Place, drive: str | os.PathLike[str]) -> Place:
    """Return where labels lie, with the drive's name in their paths: its file's, without ending."""
    path = Path(drive)
    name = path.name if path.is_dir() else path.stem
    images = place.images and place.images.replace(DRIVE, name)
    return replace(place, path=place.path.replace(DRIVE, name), images=images)
