"""Configurations as TOML files, both ways."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from roadeval.config.errors import ConfigError
from roadeval.config.run import RunConfig, configure
from roadeval.runtime.files import check_input
from roadeval.runtime.text import visible, visible_lines


def load_config(path: str | Path, preset: str | None = None, *, trusted: bool = True) -> RunConfig:
    """Read the configuration of a run from a TOML file.

    Parameters
    ----------
    path
        The file, in the shape that `roadeval.config.run` describes.
    preset
        The preset to start from where the file names none; ``paper`` otherwise.
    trusted
        Whether the user has named the file; one that came with results, or lies in a recording,
        loads no code.

    Raises
    ------
    ConfigError
        If the file is missing, no TOML, or holds a key or a value that cannot be used.
    """
    base = {} if preset is None else {"preset": preset}
    return configure({**base, **read_tables(path, trusted=trusted)}, where=str(path))


def read_tables(path: str | Path, *, trusted: bool = True) -> dict[str, Any]:
    """Read the tables of a TOML file, or of the ``run.toml`` that a recording holds.

    A `ConfigError` if there are none to read, or they name code that may not be loaded: see
    `load_config`.
    """
    try:
        tables = tomllib.loads(_text(Path(path)))
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: there is no such configuration file") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from error
    if not trusted or Path(path).suffix == ".rrd":
        _refuse_code(tables, path)
    return tables


def _refuse_code(tables: Mapping[str, Any], path: str | Path) -> None:
    """Refuse, as a `ConfigError`, a chain that names a module: the file may be anybody's."""
    variants = tables.get("variants", {})
    asked = [tables, *(variants.values() if isinstance(variants, Mapping) else ())]
    for each in asked:
        chain = each.get("chain", ()) if isinstance(each, Mapping) else ()
        for name in chain if isinstance(chain, list) else ():
            if isinstance(name, str) and ":" in name:
                raise ConfigError(
                    f"{path}: its chain names code, {visible(name)}, which is loaded only from a "
                    "TOML file that you give: replay the drive with the run.toml of its results"
                )


def _text(path: Path) -> str:
    check_input(path)
    if path.suffix != ".rrd":
        return path.read_text(encoding="utf-8-sig")  # some editors begin a file with a mark
    from roadeval.recording import Recording

    text = Recording(path).result("run")
    if text is None:
        raise ConfigError(
            f"{path}: holds no configuration, for the run was cut: replay the drive once with its "
            "options, and that recording holds them"
        )
    return text


def run_toml(config: RunConfig, drive: str, version: str, command: str = "replay") -> str:
    """Write the TOML file that makes a run again, with every effective setting.

    Parameters
    ----------
    config, drive, version
        Of the run; for a person the drive's name, or how many there are.
    command
        That takes the file.
    """
    import tomlkit

    document = tomlkit.document()
    document.add(
        tomlkit.comment(
            f"The configuration of a {command} of {visible(drive)} by roadeval {version}."
        )
    )
    document.add(
        tomlkit.comment(
            f"To repeat the run, give this file to roadeval {command} as its configuration."
        )
    )
    for key, value in without_none(config.as_dict()).items():
        document.add(key, value)
    return visible_lines(tomlkit.dumps(document))


def without_none(value: Any) -> Any:
    """Return plain data as TOML has it: without settings that are None, and with lists."""
    if isinstance(value, Mapping):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    return [without_none(item) for item in value] if isinstance(value, list | tuple) else value
