"""The synthetic world of the benchmarks, and the drive of it that ships."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import roadeval
from benchmarks.world import DEMO as SHIPPED
from benchmarks.world import IMAGE_TOPIC, drive, render_drive

DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"


def messages(path):
    """Topic, stamp and payload of every message, read by MCAP's own decoders."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, image.timestamp.ToNanoseconds(), image.data)
            for _, channel, _, image in reader.iter_decoded_messages()
        ]


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def test_the_shipped_drive_is_whole_and_small():
    found = messages(DEMO)
    assert DEMO.stat().st_size <= 8_000_000
    assert [topic for topic, _, _ in found].count(IMAGE_TOPIC) == 100
    assert {*np.diff([stamp for topic, stamp, _ in found if topic == IMAGE_TOPIC])} == {500_000_000}


@pytest.mark.sweep  # ten seconds for the models of houses and trees
def test_the_shipped_drive_is_what_the_code_renders():
    """Up to what another version of a library may round differently."""
    image, road, shadow = (data for _, _, data in messages(DEMO)[:3])
    frame = next(render_drive(SHIPPED))
    jpeg = decoded(drive.to_jpeg(frame.image)).astype(int)
    assert np.abs(jpeg - decoded(image)).mean() < 1.0
    assert np.mean(decoded(road) != frame.road * 255) < 0.001
    assert np.mean(decoded(shadow) != frame.shadow * 255) < 0.005


def test_the_demo_is_the_shipped_drive(tmp_path):
    assert roadeval.demo(tmp_path / "it.mcap").read_bytes() == DEMO.read_bytes()
