"""A message encoding is one file of a folder."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from roadeval.logs import TopicKind, describe, open_log
from roadeval.logs.messages import encodings, pictures
from tests.logs.making import grey, png

SOURCE = """
from types import SimpleNamespace

from roadeval.logs.messages.encoding import Encoding, MessageReader, TopicKind


def read(data):
    return SimpleNamespace(data=bytes.fromhex(bytes(data).decode()), format="png")


ENCODINGS = (
    Encoding("hexadecimal", lambda schema: MessageReader(read), {"Snapshot": TopicKind.COMPRESSED}),
)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that counts as part of the encodings' own."""
    monkeypatch.setattr(encodings, "__path__", [*encodings.__path__, str(tmp_path)])
    pictures.message_encodings.cache_clear()
    yield tmp_path
    pictures.message_encodings.cache_clear()


@pytest.fixture
def log(folder: Path) -> Path:
    """A log of one image in an encoding, and with a schema, of which nothing here knows."""
    path = folder / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("mine/Snapshot", "", b"")
        channel = writer.register_channel("/camera", "hexadecimal", schema)
        writer.add_message(channel, 5, png(grey(70)).hex().encode(), 5)
        writer.finish()
    return path


def test_a_new_file_is_enough_to_describe_and_replay_its_logs(folder: Path, log: Path) -> None:
    (folder / "hexadecimal.py").write_text(SOURCE)
    (topic,) = describe(log).topics
    assert (topic.kind, topic.format, topic.size) == (TopicKind.COMPRESSED, "png", (8, 6))
    with open_log(log) as opened:
        frame = next(opened.frames(opened.select())).decode()
    assert np.array_equal(frame.image, np.full((6, 8, 3), 70))


def test_without_the_file_the_topic_carries_no_images(log: Path) -> None:
    assert describe(log).topics[0].kind is TopicKind.OTHER
    assert "no image topic" in describe(log).problem
