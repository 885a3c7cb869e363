"""The synthetic world of the benchmarks, and the drive of it that ships."""

from dataclasses import replace
from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import roadeval
from benchmarks.world import (
    DEMO as SHIPPED,
)
from benchmarks.world import (
    IMAGE_TOPIC,
    ROAD_TOPIC,
    SHADOW_TOPIC,
    RenderSettings,
    drive,
    render_drive,
    write_drive,
)
from benchmarks.world.scene import build

DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"


@pytest.fixture(scope="module")
def same_scene():
    """Drives of one seed and length have one scene, which is built once: it takes seconds."""
    built = {}

    def build_once(journey, rng):
        if journey not in built:
            built[journey] = build(journey, rng)
        return built[journey]

    with mock.patch.object(drive, "build", build_once):
        yield


@pytest.fixture(scope="module")
def frames(same_scene):
    """The journey of the shipped drive: half as many and small frames."""
    small = replace(SHIPPED, frames=50, width=160, height=120, rate_hz=1.0)
    return list(render_drive(small))


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


def test_the_drive_looks_as_it_did(frames, request):
    """Every fifth frame, small; ``python -m pytest tests/world --write-golden`` draws them anew.

    The masks stand below the image. A change of a few levels may be another library's rounding.
    """
    sheet = np.hstack([small(frame) for frame in frames[2::5]])
    golden = Path(__file__).parent / "expected.png"
    if request.config.getoption("--write-golden", default=False):
        cv2.imwrite(str(golden), sheet)
    off = np.abs(sheet.astype(int) - cv2.imread(str(golden)))
    assert off.max() <= 6
    assert off.mean() <= 0.1


def small(frame):
    """A frame and its masks, a quarter as wide and high: that takes most of the noise away."""
    masks = np.hstack([frame.road, frame.shadow])[..., None].repeat(3, axis=2) * np.uint8(255)
    whole = np.vstack([frame.image[..., ::-1], cv2.resize(masks, (160, 120))])
    return cv2.resize(whole, (40, 60), interpolation=cv2.INTER_AREA)


def test_the_same_settings_give_the_same_bytes(tmp_path):
    for name in "ab":
        write_drive(tmp_path / name, RenderSettings(frames=2, width=160, height=120, seed=3))
    first, again = ((tmp_path / name).read_bytes() for name in "ab")
    assert first == again
    found = messages(tmp_path / "a")
    assert [topic for topic, _, _ in found] == [IMAGE_TOPIC, ROAD_TOPIC, SHADOW_TOPIC] * 2
    assert found[0][1] == found[1][1] == found[2][1] == found[3][1] - 100_000_000


def test_the_shipped_drive_is_whole_and_small():
    found = messages(DEMO)
    assert DEMO.stat().st_size <= 8_000_000
    assert [topic for topic, _, _ in found].count(IMAGE_TOPIC) == 100
    assert {*np.diff([stamp for topic, stamp, _ in found if topic == IMAGE_TOPIC])} == {500_000_000}


def test_the_shipped_drive_is_what_the_code_renders(same_scene):
    """Up to what another version of a library may round differently."""
    image, road, shadow = (data for _, _, data in messages(DEMO)[:3])
    frame = next(render_drive(SHIPPED))
    jpeg = decoded(drive.to_jpeg(frame.image)).astype(int)
    assert np.abs(jpeg - decoded(image)).mean() < 1.0
    assert np.mean(decoded(road) != frame.road * 255) < 0.001
    assert np.mean(decoded(shadow) != frame.shadow * 255) < 0.005


def test_the_demo_is_the_shipped_drive(tmp_path):
    assert roadeval.demo(tmp_path / "it.mcap").read_bytes() == DEMO.read_bytes()
