"""Where a report comes from: the log, the settings, the versions, and how to make it again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from roadeval.data import FILTERED, UNFILTERED
from roadeval.jobs.asked import typed
from roadeval.report.blocks import Block, Columns, Command, Heading, Table, Text, Together
from roadeval.report.findings import Findings


def origin(found: Findings) -> Iterator[Block]:
    """Say what was run on what, and how to run it again."""
    summary = found.summary
    yield Heading("Settings, versions, and how to reproduce this")
    log = summary.get("log", {})
    if log:
        yield Text(f"Log: {log['path']}")
        yield Text(f"SHA-256: {log['sha256']}")
        yield Command(_replay(found, log["path"]))
        yield Text(
            "Settings that differ from the preset's go into a file for --config, and those of a "
            "variant into the file that --variant names; the same log, settings and versions give "
            "the same numbers.",
            "note",
        )
    for topic in summary["drive"].get("topics", ()):
        yield Text(str(topic), "note")
    if found.properties:
        yield Text(
            "; ".join(f"{key}: {value}" for key, value in found.properties.items() if value != ""),
            "note",
        )
    versions = [[name, str(value)] for name, value in summary.get("versions", {}).items()]
    seconds = [
        [variant, stage, f"{1e3 * value:.2f}"]
        for variant, stages in summary.get("seconds", {}).items()
        for stage, value in stages.items()
    ]
    if versions or seconds:
        yield Columns(
            [Table(["<package", "<version"], versions, small=True)] if versions else [],
            [Table(["<variant", "<stage", "ms a frame"], seconds, small=True)] if seconds else [],
        )
    if summary.get("settings"):
        rows = _settings(summary["settings"])
        half = -(-len(rows) // 2)
        tables = Columns([_settings_table(rows[:half])], [_settings_table(rows[half:])])
        yield Together([Heading("Settings", 2), tables])


def flattened(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings by their dotted names, as ``svm.kernel``."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{name}.")
        elif isinstance(value, list | tuple):
            yield f"{prefix}{name}", ", ".join(map(str, value))
        else:
            yield f"{prefix}{name}", "none" if value is None else str(value)


def _settings_table(rows: list[list[str]]) -> Table:
    return Table(["<setting", "<value"], rows, small=True)


def _settings(settings: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """List the settings: one value where the variants agree, else each one's."""
    own = {variant: dict(flattened(each)) for variant, each in settings.items()}
    names = list(dict.fromkeys(name for each in own.values() for name in each))
    rows = []
    for name in names:
        values = {variant: each[name] for variant, each in own.items() if name in each}
        if len(set(values.values())) == 1:
            only = "" if len(values) == len(own) else f" ({', '.join(values)} only)"
            rows.append([name, next(iter(values.values())) + only])
        else:
            rows.append([name, "; ".join(f"{v}: {text}" for v, text in values.items())])
    return rows


def _replay(found: Findings, path: str) -> str:
    words = ["roadeval", "replay", path]
    if found.properties.get("preset"):
        words += ["--preset", str(found.properties["preset"])]
    # The topics that were picked are named, asked for or not.
    picked = {name: found.properties.get(name) for name in ("image_topic", "truth_topic")}
    asked = found.summary.get("selection") or {}
    words += typed(asked | {name: topic for name, topic in picked.items() if topic})
    settings = found.summary.get("settings") or {}
    for name in [name for name in settings if name not in (FILTERED, UNFILTERED)]:
        words += ["--variant", f"{name}={name}.toml"]
    training = found.summary.get("training", {})
    if training.get("model"):
        words += ["--model", str(training["model"])]
    elif training.get("frames"):
        words += ["--train-frames", str(training["frames"])]
        # All variants of a run are trained alike.
        gap = next((each["training"]["gap"] for each in settings.values()), 0)
        words += ["--train-gap", str(gap)] if gap else []
    return shlex.join(words)
