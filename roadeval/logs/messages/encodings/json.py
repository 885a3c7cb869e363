"""JSON: bytes in base 64, or as a list of numbers."""

from __future__ import annotations

import base64
import json
from types import SimpleNamespace

from mcap.records import Schema

from roadeval.logs.container.records import Buffer
from roadeval.logs.messages.encoding import Encoding, MessageReader, TopicKind


def _reader(_schema: Schema | None) -> MessageReader:
    return MessageReader(_decode)


def _decode(data: Buffer) -> SimpleNamespace:
    message: SimpleNamespace = json.loads(
        bytes(data), object_hook=lambda fields: SimpleNamespace(**fields)
    )
    if isinstance(message.data, str):
        message.data = base64.b64decode(message.data, validate=True)
    else:
        message.data = bytes(message.data)
    return message


ENCODING = Encoding("json", _reader, without_schema=TopicKind.COMPRESSED)
