"""What was learnt, for every variant, and the file that keeps it: arrays and JSON, no code."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.errors import RoadevalError
from roadeval.pipeline.chain import STAGES

FORMAT: Final = "roadeval-model"
VERSION: Final = 1


class ModelError(RoadevalError):
    """A model file that cannot be used, and why."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What training gave.

    Parameters
    ----------
    parameters
        By variant, then by stage: what the stage learnt.
    settings
        By variant: the settings that training depended on (filters, and stages that learn).
    source
        ``truth`` or ``patch``.
    digests
        The hashes of the frames that trained it (`roadeval.data.Frame.digest`). They are never
        evaluated.
    pixels
        Number of training pixels.
    prior
        ``(H, W)`` float32: the share of training frames in which a pixel was road, which is
        what the blind baseline thresholds; None without truth.
    warnings
        What a user should know before believing a result.
    """

    parameters: Mapping[str, Mapping[str, Any]]
    settings: Mapping[str, Mapping[str, Any]]
    source: str
    digests: frozenset[str]
    pixels: int
    prior: npt.NDArray[np.float32] | None = None
    warnings: tuple[str, ...] = field(default=())

    def require(self, variant: str, settings: Mapping[str, Any], path: Path) -> None:
        """Refuse, as a `ModelError`, a variant that this model was not made for."""
        if variant not in self.settings:
            known = ", ".join(sorted(self.settings))
            raise ModelError(
                f"{path}: the model has no variant {variant} (it has {known}); "
                "train one with the same --config and --variant options"
            )
        made_for = self.settings[variant]
        # Through JSON, as the file has been: tuples and lists are the same there.
        wanted = json.loads(json.dumps(settings))
        for name in sorted({*made_for, *wanted}):
            if made_for.get(name) != wanted.get(name):
                raise ModelError(
                    f"{path}: the model was made for other settings of {name} in variant "
                    f"{variant} ({_difference(made_for.get(name), wanted.get(name))}); "
                    "train one with the settings of this run"
                )


def _difference(made_for: Any, wanted: Any) -> str:
    if not (isinstance(made_for, dict) and isinstance(wanted, dict)):
        return f"{made_for} there, {wanted} here"
    keys = [k for k in {**made_for, **wanted} if made_for.get(k) != wanted.get(k)]
    return ", ".join(f"{k} {made_for.get(k)} there, {wanted.get(k)} here" for k in keys)


def save_model(model: Model, path: Path) -> None:
    """Write a model file: a NumPy archive of plain arrays and one JSON text.

    It appears under its name only when it is complete. The same model gives the same bytes.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    for variant, stages in model.parameters.items():
        for stage, parameters in stages.items():
            for entry in dataclasses.fields(parameters):
                arrays[f"{variant}/{stage}/{entry.name}"] = np.asarray(
                    getattr(parameters, entry.name)
                )
    if model.prior is not None:
        arrays["prior"] = model.prior
    header = {
        "format": FORMAT,
        "version": VERSION,
        "settings": model.settings,
        "source": model.source,
        "digests": sorted(model.digests),
        "pixels": model.pixels,
        "warnings": model.warnings,
    }
    arrays["header"] = np.frombuffer(json.dumps(header, sort_keys=True).encode(), np.uint8)
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise ModelError(f"{path}: cannot write the model: {error.strerror}") from error


def load_model(path: Path) -> Model:
    """Read a model file; it holds data alone, so a file from elsewhere runs no code.

    Raises
    ------
    ModelError
        If the file is missing, no model, damaged, or of a later version.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(arrays.pop("header").tobytes())
    except FileNotFoundError as error:
        raise ModelError(f"{path}: there is no such model file") from error
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise ModelError(
            f"{path}: not a model file, or a damaged one; make one with 'roadeval train'"
        ) from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ModelError(f"{path}: not a model file; make one with 'roadeval train'")
    if header.get("version") != VERSION:
        raise ModelError(
            f"{path}: model format {header.get('version')}, this version reads {VERSION}; "
            "train it again"
        )
    try:
        return _model(header, arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(f"{path}: the model file is incomplete: {error}") from error


def _model(header: Mapping[str, Any], arrays: dict[str, npt.NDArray[Any]]) -> Model:
    prior = arrays.pop("prior", None)
    parts: dict[str, dict[str, dict[str, Any]]] = {variant: {} for variant in header["settings"]}
    for name, array in arrays.items():
        variant, stage, entry = name.split("/")
        parts[variant].setdefault(stage, {})[entry] = array.item() if array.ndim == 0 else array
    return Model(
        {
            variant: {stage: _parameters(stage, values) for stage, values in stages.items()}
            for variant, stages in parts.items()
        },
        header["settings"],
        header["source"],
        frozenset(header["digests"]),
        int(header["pixels"]),
        prior,
        tuple(header["warnings"]),
    )


def _parameters(stage: str, values: Mapping[str, Any]) -> Any:
    kind = STAGES[stage].parameters
    if kind is None:
        raise ValueError(f"stage {stage} learns nothing")
    return kind(**values)
