"""JSON schemas of what people write and read: ``run.toml`` and ``summary.json``.

``python docs/generated.py`` writes them into ``docs/schemas``. Editors complete a TOML file whose
first line names the schema, and validators check what a pipeline hands on.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from inspect import getdoc
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter

from roadeval.config.run import RunConfig
from roadeval.config.settings import SECTIONS
from roadeval.config.variants import PRESETS
from roadeval.logs.settings import CameraSettings, MaskSettings
from roadeval.pipeline.stages import STAGES
from roadeval.results.facts import Facts
from roadeval.runtime.settings import meanings

FOLDER: Final = Path(__file__).resolve().parent / "schemas"
DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


def of_run() -> Schema:
    """Return the schema of ``run.toml``, and of every file for ``--config`` and ``--variant``."""
    defaults = RunConfig()
    kinds = {
        **{name: stage.settings for name, stage in STAGES.items()},
        **{name: type(getattr(defaults, name)) for name in SECTIONS},
        "masks": MaskSettings,
        "cameras": CameraSettings,
    }
    tables, shared = TypeAdapter.json_schemas(
        [(name, "validation", TypeAdapter(kind)) for name, kind in kinds.items()]
    )
    definitions = shared["$defs"]
    for settings in kinds.values():
        for kind in _with_inner(settings):
            _describe(definitions[kind.__name__], kind)
    table = {name: tables[name, "validation"] for name in kinds}
    chain = {
        "preset": {"enum": [*PRESETS], "description": "The settings that the others change."},
        "chain": {
            **_list_of({"type": "string"}),
            "description": f"Stages in their order: {', '.join(STAGES)}, or module:name.",
        },
        **{name: table[name] for name in STAGES},
    }
    variant = {"type": "object", "properties": chain}
    return {
        "$schema": DRAFT,
        "title": "Configuration of roadeval",
        "type": "object",
        "properties": {
            **chain,
            "only": {**_list_of({"type": "string"}), "description": "The variants that run."},
            **{name: table[name] for name in SECTIONS},
            "variants": {"type": "object", "additionalProperties": variant},
            "masks": {"type": "object", "additionalProperties": table["masks"]},
            "cameras": _list_of(table["cameras"]),
        },
        # Stages from elsewhere have tables of their own.
        "additionalProperties": {"type": "object"},
        "$defs": definitions,
    }


def of_summary() -> Schema:
    """Return the schema of ``summary.json``: that of its facts, with differences by variant."""
    schema = TypeAdapter(Facts).json_schema(mode="serialization")
    definitions = schema["$defs"]
    facts = definitions["Facts"]
    rates = definitions.pop("Effect")["properties"]["rates"]
    del facts["properties"]["effects"]
    for name in ("difference", "against_unfiltered", "against_blind", "against_method"):
        facts["properties"][name] = {"type": "object", "additionalProperties": rates}
    facts["properties"] |= {
        "format": {
            "type": "object",
            "properties": {"name": {"const": "roadeval-summary"}, "version": {"type": "integer"}},
        },
        "digest": {"type": "object", "additionalProperties": True},
    }
    facts["required"] = [name for name in facts["required"] if name != "effects"]
    return {"$schema": DRAFT, "title": "Summary of a result of roadeval", **_nullable(schema)}


def _nullable(schema: Any) -> Any:
    """Let every number be null, as undefined ones are."""
    if isinstance(schema, list):
        return [*map(_nullable, schema)]
    if not isinstance(schema, dict):
        return schema
    inner = {key: _nullable(value) for key, value in schema.items() if key != "default"}
    return inner | {"type": ["number", "null"]} if schema.get("type") == "number" else inner


def _with_inner(kind: type) -> Iterator[type]:
    """Yield a settings class, and the classes of the tables in it."""
    yield kind
    for field in fields(kind):
        if is_dataclass(field.default_factory) and isinstance(field.default_factory, type):
            yield from _with_inner(field.default_factory)


def _describe(schema: Schema, kind: type) -> None:
    """Add the meanings of settings, and refuse others."""
    schema["description"] = (getdoc(kind) or "").partition("\n")[0]
    schema["additionalProperties"] = False
    for name, text in meanings(kind).items():
        schema["properties"][name]["description"] = text.replace("``", "")


def _list_of(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def write() -> None:
    """Write both schemas."""
    FOLDER.mkdir(exist_ok=True)
    for name, schema in (("run", of_run()), ("summary", of_summary())):
        text = json.dumps(schema, indent=1, ensure_ascii=False)
        (FOLDER / f"{name}.schema.json").write_text(f"{text}\n", encoding="utf-8")
