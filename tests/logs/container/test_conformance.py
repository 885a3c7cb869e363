"""Every combination of what MCAP leaves open: each message, channel and schema as expected."""

import json
from pathlib import Path
from typing import Any

import pytest

from roadeval.logs.container.file import containers_in, damage_of
from roadeval.logs.container.records import Message
from tests.fixtures import conformance
from tests.fixtures.shared import shared

FOLDERS = "NoData OneAttachment OneMessage OneMetadata OneSchemalessMessage TenMessages"


def plain(value: Any) -> Any:
    """A value as the suite's JSON writes it: numbers and bytes as strings."""
    if isinstance(value, bytes | memoryview):
        return [str(byte) for byte in value]
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    return value if isinstance(value, str) else str(value)


def fields(record: Any) -> dict[str, Any]:
    named = record._asdict() if isinstance(record, Message) else vars(record)
    return {key: plain(value) for key, value in named.items()}


Suite = list[tuple[Path, list[tuple[str, dict[str, Any]]]]]
"""Logs, and the records expected of each, by kind and fields."""


def here(content: str, folder: Path) -> Suite:
    """Write every variant of a content, and read its records by the MCAP project's reader."""
    suite = []
    for name, data in conformance.variants(content):
        path = folder / f"{name}.mcap"
        path.write_bytes(data)
        found_records = [
            (type(record).__name__, fields(record)) for record in conformance.records(data)
        ]
        suite.append((path, [record for record in found_records if record[0] != "MessageIndex"]))
    return suite


def published(folder: Path) -> Suite:
    """Return the MCAP project's suite, and what it says itself."""
    suite = []
    for path in sorted(folder.glob("*.mcap")):
        listed = json.loads(path.with_suffix(".json").read_text())["records"]
        suite.append((path, [(record["type"], dict(record["fields"])) for record in listed]))
    return suite


@pytest.fixture(params=[*conformance.CONTENTS, *shared("mcap", "conformance")], ids=str)
def suite(request: pytest.FixtureRequest, tmp_path: Path) -> Suite:
    if isinstance(request.param, str):
        return here(request.param, tmp_path)
    return [case for folder in FOLDERS.split() for case in published(request.param / folder)]


def test_every_message_topic_and_schema_is_found_and_nothing_is_called_damaged(suite: Suite):
    assert suite
    for path, expected in suite:
        (container,) = containers_in(path, lambda *_: True, lambda *_: 0)
        found_records = [
            ("Message", fields(container.message(chunk, offset)))
            for log in container.logs.values()
            for chunk, entries in log.blocks
            for _, offset in entries.tolist()
        ]
        assert damage_of(container) == (), path.name
        container.close()
        assert found_records == [record for record in expected if record[0] == "Message"], path.name
        for kind, described in (("Channel", container.channels), ("Schema", container.schemas)):
            records = {number: (kind, fields(record)) for number, record in described.items()}
            listed = {int(record[1]["id"]): record for record in expected if record[0] == kind}
            assert records == listed, path.name
