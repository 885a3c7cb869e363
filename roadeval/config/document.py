"""Configurations as TOML: the file of a run, and one that explains every setting."""

from __future__ import annotations

import dataclasses
import inspect
import textwrap
import types
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from roadeval.config.run import RunConfig
from roadeval.config.settings import SECTIONS
from roadeval.pipeline import stages
from roadeval.pipeline.chain import Pipeline
from roadeval.runtime.settings import meanings
from roadeval.runtime.text import visible, visible_lines

WIDTH: Final = 100
_BOUNDS: Final = {"ge": "at least {}", "gt": "above {}", "le": "at most {}", "lt": "below {}"}


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
    parts += [tomlkit.dumps({"drives": [drive.as_dict()]}).strip() for drive in config.drives]
    return "\n\n".join(parts) + "\n"


def _chain(pipeline: Pipeline) -> Iterator[str]:
    yield from _comment(f"The stages in the order they run; there are {', '.join(stages.names())}.")
    yield f"chain = [{', '.join(f'{name!r}' for name in pipeline.chain)}]".replace("'", '"')


def _stages(pipeline: Pipeline, prefix: str) -> list[str]:
    return [_table(f"{prefix}{name}", own) for name, own in pipeline.settings.items()]


def _table(name: str, settings: Any) -> str:
    """Write the table of a settings dataclass; dataclasses in it follow as tables."""
    texts = meanings(type(settings))
    hints = get_type_hints(type(settings), include_extras=True)
    title = (inspect.getdoc(type(settings)) or "").partition("\n\n")[0]
    lines, inner = [*_comment(title), f"[{name}]"], []
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            inner.append(_table(f"{name}.{field.name}", value))
            continue
        allowed = _allowed(hints[field.name])
        lines += ["", *_comment(" ".join(filter(None, (texts.get(field.name), allowed))))]
        lines.append(_assignment(field.name, value))
    return "\n\n".join(["\n".join(lines), *inner])


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


def _allowed(hint: Any) -> str:
    """Describe the allowed values of a setting's type; empty where all are allowed."""
    if get_origin(hint) in (Union, types.UnionType):
        known = (_allowed(each) for each in get_args(hint) if each is not type(None))
        return next(filter(None, known), "")
    if get_origin(hint) is Literal:
        return f"One of {', '.join(map(str, get_args(hint)))}."
    if get_origin(hint) is not Annotated:
        return ""
    kind, *constraints = get_args(hint)
    bounds = ", ".join(_bounds(constraints)).capitalize()
    return " ".join(filter(None, (_allowed(kind), f"{bounds}." if bounds else "")))


def _bounds(constraints: Iterable[Any]) -> Iterator[str]:
    """Yield the bounds among a type's constraints; a pydantic field holds several."""
    for constraint in constraints:
        for each in getattr(constraint, "metadata", None) or [constraint]:
            yield from (
                text.format(getattr(each, name))
                for name, text in _BOUNDS.items()
                if getattr(each, name, None) is not None
            )
