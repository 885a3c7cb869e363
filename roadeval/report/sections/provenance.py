"""Settings and versions behind the results, and the command that makes them again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from roadeval.report.blocks import Block, Command, Heading, KeepTogether, Table, Text, TwoColumns
from roadeval.report.findings import Commands, Findings

TABLES: Final = ("topics", "labels", "frames", "training", "evaluation")
"""Of the run's configuration, beside its stages: what can change a number."""


def section(findings: Findings) -> Iterator[Block]:
    """Yield what was run on what, and how to run it again."""
    summary = findings.summary
    yield Heading("Settings, versions, and how to reproduce this")
    if summary.get("log"):
        yield from _log(summary["log"], findings.commands)
    for topic in summary["drive"].get("topics", ()):
        yield Text(str(topic), "note")
    if findings.properties:
        # The digest of the input says less than the log's checksum and the settings around it.
        told = ((name, value) for name, value in findings.properties.items() if name != "input")
        known = {name: value for name, value in told if value != ""}
        yield Text("; ".join(f"{name}: {value}" for name, value in known.items()), "note")
    yield from _methods(summary)
    yield from _versions_and_seconds(summary)
    if summary.get("settings"):
        yield _settings(summary["settings"], summary["run"])


def _log(log: Mapping[str, Any], commands: Commands | None) -> Iterator[Block]:
    yield Text(f"Log: {log['path']}")
    yield Text(f"SHA-256: {log['sha256']}")
    if commands and commands.again:
        yield Command(commands.again(log["path"]))
        yield Text("The same log, configuration and versions give the same numbers.", "note")


def _methods(summary: Mapping[str, Any]) -> Iterator[Block]:
    """Yield what stages tell of themselves, as networks do, with the time that each takes."""
    for variant, stages in summary.get("methods", {}).items():
        for stage, told in stages.items():
            seconds = summary.get("seconds", {}).get(variant, {}).get(stage)
            time = {} if seconds is None else {"ms a frame": f"{1e3 * seconds:.2f}"}
            facts = {name: value for name, value in flattened(told) if value != "none"} | time
            rows = [[name, value] for name, value in facts.items()]
            yield KeepTogether([Heading(f"{variant}: {stage}", 2), _words(["what", "value"], rows)])


def _settings(variants: Mapping[str, Mapping[str, Any]], run: Mapping[str, Any]) -> Block:
    """Return the variants' settings, and the run's that can change a number, in two columns."""
    first = {"preset": run["preset"]} if "preset" in run else {}
    shared = {name: run[name] for name in TABLES if name in run}
    rows = settings_rows({name: {**first, **own, **shared} for name, own in variants.items()})
    half = -(-len(rows) // 2)
    left, right = (_words(["setting", "value"], part) for part in (rows[:half], rows[half:]))
    return KeepTogether([Heading("Settings", 2), TwoColumns([left], [right])])


def _versions_and_seconds(summary: Mapping[str, Any]) -> Iterator[Block]:
    versions = [[name, str(value)] for name, value in summary.get("versions", {}).items()]
    seconds = [
        [variant, stage, f"{1e3 * value:.2f}"]
        for variant, stages in summary.get("seconds", {}).items()
        for stage, value in stages.items()
    ]
    if versions or seconds:
        yield TwoColumns(
            [_words(["package", "version"], versions)] if versions else [],
            [_words(["variant", "stage", "ms a frame"], seconds)] if seconds else [],
        )


def _words(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a small table whose first two columns are words."""
    return Table(columns, rows, text_columns=(0, 1), small=True)


def settings_rows(settings: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Return name and value of the settings: one value where the variants agree, else each one's.

    Parameters
    ----------
    settings
        By variant, nested as in a TOML file.
    """
    own = {variant: dict(flattened(each)) for variant, each in settings.items()}
    names = dict.fromkeys(name for each in own.values() for name in each)
    return [[name, _value(name, own)] for name in names]


def _value(name: str, own: Mapping[str, Mapping[str, str]]) -> str:
    """Return the value that a setting has in every variant that has it, or each one's."""
    values = {variant: each[name] for variant, each in own.items() if name in each}
    if len(set(values.values())) > 1:
        return "; ".join(f"{variant}: {text}" for variant, text in values.items())
    only = "" if len(values) == len(own) else f" ({', '.join(values)} only)"
    return next(iter(values.values())) + only


def _as_in_toml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def flattened(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings by their dotted names.

    >>> list(flattened({"svm": {"kernel": "rbf"}, "frames": {"scale": 1.0}}))
    [('svm.kernel', 'rbf'), ('frames.scale', '1.0')]
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{name}.")
        elif isinstance(value, list | tuple):
            yield f"{prefix}{name}", ", ".join(map(str, value)) or "none"
        else:
            yield f"{prefix}{name}", "none" if value is None else _as_in_toml(value)
