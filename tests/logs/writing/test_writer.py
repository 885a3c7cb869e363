"""Logs that are written can be read, here and elsewhere."""

import errno
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

from roadeval.logs.errors import LogError
from roadeval.logs.writing.writer import LogWriter
from tests.logs.making import grey, jpeg


def write(path: Path) -> Path:
    with LogWriter(path) as log:
        for stamp in (10, 20):
            log.image("/camera", stamp, jpeg(grey(stamp)), "jpeg", log_time_ns=stamp + 1)
            log.mask("/truth/road", stamp, grey(255))
    return path


def test_foxgloves_own_decoder_reads_it(tmp_path: Path) -> None:
    with write(tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [
            (schema.name, channel.topic, decoded.timestamp.ToNanoseconds(), decoded.format)
            for schema, channel, _, decoded in reader.iter_decoded_messages()
        ]
    name = "foxglove.CompressedImage"
    assert sorted(messages) == [
        (name, "/camera", 10, "jpeg"),
        (name, "/camera", 20, "jpeg"),
        (name, "/truth/road", 10, "png"),
        (name, "/truth/road", 20, "png"),
    ]


def test_nothing_is_left_of_a_log_that_cannot_be_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_writer: Writer) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, "finish", full)
    path = tmp_path / "a.mcap"
    with pytest.raises(LogError, match="cannot be written: No space left"):
        write(path)
    assert list(tmp_path.iterdir()) == []
