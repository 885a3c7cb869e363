"""The sources of the results, and the command that makes them again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from roadeval.data.words import UNSET, setting
from roadeval.report.blocks import Block, Command, Details, Heading, KeepTogether, Table, Text
from roadeval.report.captions import caption, note
from roadeval.report.findings import Findings
from roadeval.results.fleet import FleetFolder


def section(findings: Findings) -> Iterator[Block]:
    """Yield the log, the methods and the command that makes the results again."""
    facts = findings.facts
    yield Heading("How to reproduce this")
    if facts.log:
        digest = Text(f"Digest of its index and checksums: {facts.log.digest}")
        again = [Command(findings.again), note("reproduced")] if findings.again else []
        yield KeepTogether([Text(f"Log: {facts.log.path}"), digest, *again])
    for name, labels in facts.masks.items():
        yield Text(f"{name}: {labels['path']}, digest {labels['digest']}", "note")
    # Stages, such as networks, describe themselves.
    for variant, stages in facts.methods.items():
        for stage, description in stages.items():
            rows = dict(flatten(description))
            if (seconds := facts.seconds.get(variant, {}).get(stage)) is not None:
                rows["ms a frame"] = f"{1e3 * seconds:.2f}"
            yield Details(f"{variant}: {stage}", [_words(["what", "value"], [*rows.items()])])
    details: list[Block] = [Text(topic, "note") for topic in facts.drive.topics]
    # The log's digest and the settings above tell more than the digest of the input.
    properties = [
        f"{name}: {value}"
        for name, value in findings.properties.items()
        if name != "input" and value != ""
    ]
    if properties:
        details.append(Text("; ".join(properties), "note"))
    if facts.versions:
        details.append(_words(["package", "version"], [*facts.versions.items()]))
    if facts.seconds:
        times = [
            [variant, stage, f"{1e3 * seconds:.2f}"]
            for variant, stages in facts.seconds.items()
            for stage, seconds in stages.items()
        ]
        details.append(_words(["variant", "stage", "ms a frame"], times))
    if details:
        yield Details("Topics, versions, milliseconds", details, on_paper=False)


def of_drives(findings: FleetFolder) -> Iterator[Block]:
    """Yield the version that replayed many drives, and the files with the settings."""
    yield Heading("What was run")
    yield Text(caption("run of a fleet", version=findings.facts.version, folder=findings.path))


def _words(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a small table with words in its first two columns."""
    return Table(columns, rows, text_columns=(0, 1), small=True)


def flatten(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings that have a value, by their dotted names.

    >>> list(flatten({"svm": {"kernel": "rbf"}, "size": [4, 3], "seed": None}))
    [('svm.kernel', 'rbf'), ('size', '4, 3')]
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{prefix}{name}.")
        elif (text := setting(value)) != UNSET:
            yield f"{prefix}{name}", text
