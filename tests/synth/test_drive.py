"""The drive as a whole, and the log that ships."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import cv2
import numpy as np
import pytest

from roadeval.synth import (
    IMAGE_TOPIC,
    ROAD_TOPIC,
    SHADOW_TOPIC,
    DriveError,
    RenderSettings,
    SynthFrame,
    render_drive,
    write_drive,
)
from roadeval.synth.drive import to_jpeg

DEMO = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"
OTHER = RenderSettings(frames=2, width=160, height=120, rate_hz=10.0, seed=3)


def messages(path: Path) -> list[tuple[str, int, bytes]]:
    """Topic, stamp and payload of every message, read by MCAP's own decoders."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, image.timestamp.ToNanoseconds(), image.data)
            for _, channel, _, image in reader.iter_decoded_messages()
        ]


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def shaded_road(frame: SynthFrame) -> float:
    return float(frame.shadow[frame.road == 1].mean())


def test_images_and_truth_have_their_shapes_and_values(frames: list[SynthFrame]) -> None:
    for frame in frames:
        assert frame.image.shape == (120, 160, 3)
        assert (frame.image.dtype, frame.road.dtype, frame.shadow.dtype) == (np.uint8,) * 3
        assert frame.road.shape == frame.shadow.shape == (120, 160)
        assert set(np.unique(frame.road)) == {0, 1}
        assert set(np.unique(frame.shadow)) <= {0, 1}
    assert [frame.index for frame in frames] == list(range(50))


def test_a_third_is_without_shadow_a_third_moderate_a_third_heavy(
    frames: list[SynthFrame],
) -> None:
    shares = np.array([shaded_road(frame) for frame in frames])
    none = np.array([not frame.shadow.any() for frame in frames])
    moderate = shares[:16]
    heavy = shares[16:][~none[16:]]
    assert not none[:16].any()
    assert 15 <= np.count_nonzero(none) <= 18
    assert 0.05 < moderate.mean() < 0.4
    assert 0.5 < heavy.mean() < 0.95


def test_shadows_in_the_image_are_dark_and_bluish(frames: list[SynthFrame]) -> None:
    ratios = []
    for frame in frames:
        shade = cv2.erode(frame.shadow & frame.road, np.ones((3, 3), np.uint8)) == 1
        sun = cv2.erode((1 - frame.shadow) & frame.road, np.ones((3, 3), np.uint8)) == 1
        if min(shade.sum(), sun.sum()) > 200:
            ratios.append(np.median(frame.image[shade], 0) / np.median(frame.image[sun], 0))
    red, green, blue = np.median(ratios, axis=0)
    assert len(ratios) > 5
    assert 0.2 < red < green < blue < 0.6


def test_the_road_moves_in_the_image(frames: list[SynthFrame]) -> None:
    position = np.mean([frame.road for frame in frames[:10]], axis=0) >= 0.5
    missed = np.mean([(frame.road == 1) != position for frame in frames[10:]])
    assert 0.03 < missed < 0.15


@pytest.mark.parametrize(
    "wrong",
    [{"frames": 0}, {"rate_hz": 0.0}, {"rate_hz": float("nan")}, {"seed": -1}, {"width": 8},
     {"frames": 900}],
)  # fmt: skip
def test_a_drive_that_cannot_be_is_refused_in_one_line(wrong: dict[str, float]) -> None:
    with pytest.raises(DriveError) as refusal:
        RenderSettings(**wrong)  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)


def test_the_drive_looks_as_it_did(frames: list[SynthFrame], request) -> None:
    """Every fifth frame, small; ``python -m pytest tests/synth --write-golden`` draws them anew.

    The masks stand below the image. A change of a few levels may be another library's rounding.
    """
    sheet = np.hstack([small(frame) for frame in frames[2::5]])
    golden = Path(__file__).parent / "expected.png"
    if request.config.getoption("--write-golden", default=False):
        cv2.imwrite(str(golden), sheet)
    off = np.abs(sheet.astype(int) - cv2.imread(str(golden)))
    assert off.max() <= 6
    assert off.mean() <= 0.1


def small(frame: SynthFrame) -> np.ndarray:
    """A frame and its masks, a quarter as wide and high: that takes most of the noise away."""
    masks = np.hstack([frame.road, frame.shadow])[..., None].repeat(3, axis=2) * np.uint8(255)
    whole = np.vstack([frame.image[..., ::-1], cv2.resize(masks, (160, 120))])
    return cv2.resize(whole, (40, 60), interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[int, int]]]:
    """The log of two frames of another seed, and what was told while it was written."""
    path, seen = tmp_path_factory.mktemp("other") / "drive.mcap", []
    write_drive(path, OTHER, lambda done, of: seen.append((done, of)))
    return path, seen


def test_the_log_holds_image_and_truth_under_one_stamp(
    other: tuple[Path, list[tuple[int, int]]],
) -> None:
    path, seen = other
    found = messages(path)
    assert seen == [(1, 2), (2, 2)]
    assert [topic for topic, _, _ in found] == [IMAGE_TOPIC, ROAD_TOPIC, SHADOW_TOPIC] * 2
    assert found[0][1] == found[1][1] == found[2][1] == found[3][1] - 100_000_000
    images = [decoded(data) for _, _, data in found]
    assert [image.shape for image in images] == [(120, 160, 3), (120, 160), (120, 160)] * 2
    assert set(np.unique(images[1])) == {0, 255}


def test_the_same_settings_give_the_same_bytes(
    other: tuple[Path, list[tuple[int, int]]], tmp_path: Path
) -> None:
    write_drive(tmp_path / "again.mcap", OTHER)
    assert (tmp_path / "again.mcap").read_bytes() == other[0].read_bytes()


def test_another_seed_is_another_drive(
    other: tuple[Path, list[tuple[int, int]]], frames: list[SynthFrame]
) -> None:
    image, road = (decoded(data) for _, _, data in messages(other[0])[:2])
    assert np.mean(road != frames[0].road * 255) > 0.005
    assert np.abs(image[..., ::-1].astype(int) - frames[0].image).mean() > 10


def test_the_shipped_drive_is_whole_and_small() -> None:
    found = messages(DEMO)
    assert DEMO.stat().st_size <= 8_000_000
    assert [topic for topic, _, _ in found].count(IMAGE_TOPIC) == 100
    stamps = [stamp for topic, stamp, _ in found if topic == IMAGE_TOPIC]
    assert set(np.diff(stamps)) == {100_000_000}


def test_the_shipped_drive_is_what_the_code_renders(
    same_scene: Callable[[], AbstractContextManager[object]],
) -> None:
    """Up to what another version of a library may round differently."""
    image, road, shadow = (data for _, _, data in messages(DEMO)[:3])
    with same_scene():
        frame = next(render_drive(RenderSettings()))
    jpeg = decoded(to_jpeg(frame.image)).astype(int)
    assert np.abs(jpeg - decoded(image)).mean() < 1.0
    assert np.mean(decoded(road) != frame.road * 255) < 0.001
    assert np.mean(decoded(shadow) != frame.shadow * 255) < 0.005
