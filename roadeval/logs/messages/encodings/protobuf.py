"""Protocol Buffers, read by the descriptors that a schema holds."""

from __future__ import annotations

from mcap.records import Schema

from roadeval.logs.messages.encoding import Encoding, MessageReader, decode_by_library


def _reader(schema: Schema | None) -> MessageReader | None:
    from mcap_protobuf.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "protobuf", schema)
    return None if decode is None else MessageReader(decode)


ENCODING = Encoding("protobuf", _reader)
