"""Pictures that come again: the same one in another encoding, and others of the same journey."""

import cv2
import numpy as np
import pytest

from roadeval import logs
from roadeval.training.schedule import BESIDE, SAME, SIDE, Likeness, fingerprint
from tests.e2e.commands import DEMO
from tests.fixtures.shared import SHARED


def landscape(seed: int, width: int = 1800) -> np.ndarray:
    """A smooth picture of things of many sizes, 270 pixels high."""
    noise = np.random.default_rng(seed)
    grey = np.zeros((270, width), np.float32)
    for size in (9, 30, 90, 270):
        rough = noise.normal(0, size, (270 // size + 2, width // size + 2)).astype(np.float32)
        grey += cv2.resize(rough, (width, 270), interpolation=cv2.INTER_CUBIC)
    levels = 110 + 40 * grey / grey.std()
    return np.repeat(levels.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)


PLACE, OTHER = landscape(1), landscape(2)


def view(column: int, place: np.ndarray = PLACE) -> np.ndarray:
    """What a camera of 360x270 pixels sees from a column of a landscape on."""
    return np.ascontiguousarray(place[:, column : column + 360])


def encoded(image: np.ndarray, kind: str, *how: int) -> np.ndarray:
    return cv2.imdecode(cv2.imencode(kind, image, how)[1], cv2.IMREAD_COLOR)


def resized(image: np.ndarray, width: int, height: int, how: int = cv2.INTER_AREA) -> np.ndarray:
    return cv2.resize(image, (width, height), interpolation=how)


QUALITY = cv2.IMWRITE_JPEG_QUALITY
ENCODINGS = {
    "PNG": lambda image: encoded(image, ".png"),
    "JPEG 95": lambda image: encoded(image, ".jpg", QUALITY, 95),
    "JPEG 75": lambda image: encoded(image, ".jpg", QUALITY, 75),
    "JPEG 50": lambda image: encoded(image, ".jpg", QUALITY, 50),
}
KNOWN = Likeness(np.stack([fingerprint(view(column)) for column in (0, 300, 600)]))


@pytest.mark.parametrize("how", ENCODINGS)
def test_a_picture_is_the_same_in_another_encoding(how):
    assert KNOWN.of(ENCODINGS[how](view(300))) == (True, {1})


@pytest.mark.parametrize(
    "change",
    [
        lambda image: resized(image, 180, 135),
        lambda image: resized(image, 720, 540, cv2.INTER_CUBIC),
        lambda image: (image * (219 / 255) + 16).astype(np.uint8),
        lambda image: (image * 0.5).astype(np.uint8),
    ],
    ids=["half the size", "twice the size", "the range of video", "half as bright"],
)
def test_a_picture_is_the_same_in_another_size_and_range(change):
    assert KNOWN.of(change(view(600)))[0]


def test_a_picture_from_a_little_further_on_is_another_one_of_the_same_place():
    assert KNOWN.of(view(306)) == (False, {1})


def test_a_picture_of_another_place_is_like_none():
    assert KNOWN.of(view(450)) == KNOWN.of(view(300, OTHER)) == (False, frozenset())


def test_every_training_frame_of_a_place_is_named():
    near = Likeness(np.stack([fingerprint(view(column)) for column in (300, 900, 303)]))
    assert near.of(view(300))[1] == {0, 2}


def test_a_fingerprint_has_the_deviation_1_whatever_is_added_and_multiplied():
    print_ = fingerprint(view(0)).astype(np.float64)
    assert print_.shape == (SIDE * SIDE,)
    assert (abs(print_.mean()) < 1e-3, abs(print_.std() - 1) < 1e-3) == (True, True)


@pytest.mark.parametrize("level", [0, 137, 255])
def test_a_picture_of_one_brightness_is_like_nothing(level):
    flat = np.full((90, 120, 3), level, np.uint8)
    assert not fingerprint(flat).any()
    assert not Likeness(fingerprint(flat)[None]).of(flat)[0]


def distances(images: list[np.ndarray], others: list[np.ndarray]) -> list[float]:
    prints = [[fingerprint(i).astype(np.float64) for i in some] for some in (images, others)]
    return [float(np.sqrt(((a - b) ** 2).mean())) for a, b in zip(*prints, strict=True)]


DRIVES = [DEMO, *(sorted((SHARED / "drives").glob("*.mcap")) if SHARED else [])]


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: path.stem)
def test_a_frame_in_another_encoding_is_nearer_than_the_frame_beside_it(path):
    asked = logs.LogConfig(
        topics=logs.TopicSettings(truth="", shadow=""), frames=logs.FrameSettings(max_frames=40)
    )
    with logs.open_log(path, asked) as log:
        frames = log.frames(log.select())
        images = [frame.decode().image for frame in frames]
    few = images[::8]
    again = {how: distances(few, [encode(i) for i in few]) for how, encode in ENCODINGS.items()}
    assert max(map(max, again.values())) < 0.8 * SAME
    assert min(distances(images, images[1:] + images[:1])) > 2 * SAME
    assert SAME < BESIDE
