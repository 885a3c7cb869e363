"""Sources of the results, and the command that makes them again; run.toml has the settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from roadeval.data.words import UNSET, setting
from roadeval.report.blocks import Block, Command, Details, Heading, KeepTogether, Table, Text
from roadeval.report.findings import Findings
from roadeval.results.facts import Facts
from roadeval.results.fleet import FleetFolder


def section(findings: Findings) -> Iterator[Block]:
    """Yield what was run on what, and how to run it again."""
    facts = findings.facts
    yield Heading("How to reproduce this")
    if facts.log:
        yield Text(f"Log: {facts.log.path}")
        yield Text(f"Digest of its index and checksums: {facts.log.digest}")
        if findings.again:
            same = "The same log, configuration and versions give the same numbers."
            yield KeepTogether([Command(findings.again), Text(same, "note")])
    for name, labels in facts.masks.items():
        yield Text(f"{name}: {labels['path']}, digest {labels['digest']}", "note")
    yield from _methods(facts)
    about: list[Block] = [Text(topic, "note") for topic in facts.drive.topics]
    # The digest of the input says less than the log's checksum and the settings around it.
    known = {n: value for n, value in findings.properties.items() if n != "input" and value != ""}
    if known:
        about.append(Text("; ".join(f"{name}: {value}" for name, value in known.items()), "note"))
    if facts.versions:
        about.append(_words(["package", "version"], [*facts.versions.items()]))
    if facts.seconds:
        masks = ((v, stage, s) for v, own in facts.seconds.items() for stage, s in own.items())
        seconds = [[variant, stage, f"{1e3 * value:.2f}"] for variant, stage, value in masks]
        about.append(_words(["variant", "stage", "ms a frame"], seconds))
    if about:
        yield Details("Topics, versions, milliseconds", about, on_paper=False)


def of_drives(findings: FleetFolder) -> Iterator[Block]:
    """Yield what many drives were replayed with, and where its settings are."""
    yield Heading("What was run")
    yield Text(
        f"roadeval {findings.facts.version}. run.toml in {findings.path} has the whole "
        "configuration, drives.parquet each log's digest, and the model and the fold that scored "
        "it. The same logs, configuration and version give the same numbers."
    )


def _methods(facts: Facts) -> Iterator[Block]:
    """Yield what stages say of themselves, as networks do, with the time that each takes."""
    for variant, stages in facts.methods.items():
        for stage, about in stages.items():
            seconds = facts.seconds.get(variant, {}).get(stage)
            time = {} if seconds is None else {"ms a frame": f"{1e3 * seconds:.2f}"}
            known = dict(flattened(about)) | time
            rows = [[name, value] for name, value in known.items()]
            yield Details(f"{variant}: {stage}", [_words(["what", "value"], rows)])


def _words(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a small table whose first two columns are words."""
    return Table(columns, rows, text_columns=(0, 1), small=True)


def flattened(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings that are set, by their dotted names.

    >>> list(flattened({"svm": {"kernel": "rbf"}, "size": [4, 3], "seed": None}))
    [('svm.kernel', 'rbf'), ('size', '4, 3')]
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{name}.")
        elif (text := setting(value)) != UNSET:
            yield f"{prefix}{name}", text
