"""Networks as variants: the chain of one, and the file of its settings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.config.errors import ConfigError
from roadeval.config.toml import read_tables
from roadeval.config.variants import Variant

AS_IT_IS: Final[Mapping[str, Any]] = {"operations": (), "region": "all", "fill": False}
"""Settings of phase 4 that leave a mask as it is."""


def network_variant(name: str, path: str) -> Variant:
    """Return the variant of a network: its mask, which phase 4 leaves as it is.

    Parameters
    ----------
    name
        Of the variant.
    path
        An ONNX file, or a TOML file with the settings of the stage ``net``, whose ``file`` is
        found from the folder of the TOML file. Its table ``[post]`` asks for post-processing.

    Raises
    ------
    ConfigError
        If the TOML file cannot be used. The network itself is opened when it is run.
    """
    if Path(path).suffix != ".toml":
        return _variant(name, {"file": path}, {}, "")
    tables = read_tables(path)
    settings = {key: value for key, value in tables.items() if key != "post"}
    file = settings.get("file")
    if not isinstance(file, str) or not file:
        raise ConfigError(f"{path}: file must name the network, an ONNX file")
    settings["file"] = str(Path(path).parent / file)
    post = tables.get("post", {})
    if not isinstance(post, Mapping):
        raise ConfigError(f"{path}: [post] must be a table")
    return _variant(name, settings, post, path)


def _variant(
    name: str, settings: Mapping[str, Any], post: Mapping[str, Any], where: str
) -> Variant:
    tables = {"chain": ("net", "post"), "net": settings, "post": {**AS_IT_IS, **post}}
    return Variant.of(name, tables, where)
