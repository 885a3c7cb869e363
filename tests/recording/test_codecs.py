"""What comes back of a layer of each kind."""

import io
from io import BytesIO

import cv2
import numpy as np
import pytest
from PIL import Image

from roadeval.data import ERRORS, TRUTH, LayerKind, LayerSpec, Packed
from roadeval.images.decoding import palette_indices, to_labels
from roadeval.images.formats import Limits
from roadeval.recording import codecs as pngs
from roadeval.recording.codecs import codec
from roadeval.recording.layout import SHADOW_TRUTH
from tests.recording.making import NDI, POST, RINGS

HEIGHT, WIDTH = 9, 13
DRAW = np.random.default_rng(0)
RAMP = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)).astype(np.float32) / (HEIGHT + WIDTH)


def there_and_back(spec, array):
    chosen = codec(spec, array.shape[1], array.shape[0])
    return chosen.decode(chosen.encode(array))


@pytest.mark.parametrize("spec", [POST, RINGS, ERRORS, TRUTH, SHADOW_TRUTH])
def test_masks_and_labels_come_back_equal(spec):
    values = np.array([each.value for each in spec.classes], np.uint8)
    array = DRAW.choice(values, (HEIGHT, WIDTH))
    assert set(values) == set(array.flat)
    np.testing.assert_array_equal(there_and_back(spec, array), array)


def test_an_exact_number_map_comes_back_to_the_nearest_of_256_levels():
    ndi = DRAW.uniform(-1, 1, (HEIGHT, WIDTH)).astype(np.float32)
    back = there_and_back(NDI, ndi)
    assert back.dtype == np.float32
    assert np.abs(back - ndi).max() <= 1 / 255 + 1e-6


def test_a_number_map_that_need_not_be_exact_comes_back_nearly_and_at_full_size():
    spec = LayerSpec("distance", LayerKind.SCALAR, "", value_range=(0.0, 6.0), exact=False)
    back = there_and_back(spec, 6 * RAMP)
    assert back.shape == (HEIGHT, WIDTH)
    assert np.abs(back - 6 * RAMP).max() < 0.5


def test_an_image_that_need_not_be_exact_comes_back_nearly_and_at_full_size():
    spec = LayerSpec("compensated", LayerKind.RGB, "", exact=False)
    image = np.dstack([255 * RAMP, 255 - 255 * RAMP, 128 + 0 * RAMP]).astype(np.uint8)
    back = there_and_back(spec, image)
    assert back.shape == image.shape
    assert np.abs(back.astype(int) - image).mean() < 10


@pytest.mark.parametrize("spec", [POST, NDI, LayerSpec("aligned", LayerKind.RGB, "")])
def test_a_damaged_picture_is_refused(spec):
    chosen = codec(spec, WIDTH, HEIGHT)
    shape = (HEIGHT, WIDTH, 3) if spec.kind is LayerKind.RGB else (HEIGHT, WIDTH)
    payload = bytearray(chosen.encode(np.ones(shape, np.uint8)))
    payload[len(payload) // 2] ^= 1
    with pytest.raises(ValueError, match="a damaged PNG"):
        chosen.decode(bytes(payload))


def test_a_map_of_a_large_image_has_the_means_of_blocks_to_a_127th():
    drawn = DRAW.uniform(-1, 1, (1200, 1920)).astype(np.float32)
    found = codec(NDI, 1920, 1200)
    with Image.open(BytesIO(payload := found.encode(drawn))) as picture:
        assert picture.size == (384, 240)
    means = drawn.reshape(240, 5, 384, 5).mean((1, 3))
    levels = to_labels(payload, Limits())
    np.testing.assert_allclose(levels / 127.5 - 1, means, atol=1 / 127)
    assert found.decode(payload).shape == (1200, 1920)
    exact = codec(NDI, 800, 600)
    assert np.abs(exact.decode(exact.encode(drawn[:600, :800])) - drawn[:600, :800]).max() < 1 / 254


def test_a_recordings_layers_fit_beside_the_cameras_picture_of_any_size():
    """Of maps and colours: noise, which nothing packs, at sizes of real cameras."""
    distance = LayerSpec("distance", LayerKind.SCALAR, "", value_range=(0.0, 6.0), exact=False)
    for width, height in ((1280, 720), (1920, 1200), (3840, 2160)):
        noise = DRAW.uniform(-1, 1, (height, width)).astype(np.float32)
        for spec in (NDI, distance):
            assert len(codec(spec, width, height).encode(noise)) < 100_000


# --- Label images, grey levels and colours as PNG files -------------------------------------------

ROAD = [(0, 0, 0, 0), (0, 158, 115, 160)]


def decode(png):
    return palette_indices(png, Limits())


@pytest.mark.parametrize("classes", [2, 3, 4, 5, 16, 17, 256])
@pytest.mark.parametrize("width", [1, 7, 8, 13])
def test_labels_come_back_whatever_their_number_and_the_width(classes, width):
    labels = np.random.default_rng(0).integers(0, classes, (5, width)).astype(np.uint8)
    png = pngs.encode_labels(labels, [(i, 0, 0, 255) for i in range(classes)])
    np.testing.assert_array_equal(decode(png), labels)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("width", [1, 7, 8, 13, 63, 64, 65, 130])
def test_a_packed_mask_gives_the_same_file(classes, width):
    mask = np.random.default_rng(0).integers(0, 2, (5, width)).astype(np.uint8)
    palette = [(i, 0, 0, 255) for i in range(classes)]
    png = pngs.encode_labels(mask, palette)
    assert pngs.encode_labels(Packed.of(mask), palette) == png


def test_another_library_sees_the_colours_and_how_opaque_they_are():
    png = pngs.encode_labels(np.array([[0, 1]], np.uint8), ROAD)
    rgba = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))
    assert [tuple(pixel) for pixel in rgba[0]] == ROAD


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (7, 1), (9, 13), (9, 13, 3), (1, 1, 3)])
def test_levels_come_back_by_another_library(shape):
    levels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    png = pngs.encode_levels(levels)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png))), levels)
    read = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., ::-1] if levels.ndim == 3 else read, levels)


@pytest.mark.parametrize("noise", [2, 5])
def test_a_noisy_map_takes_hardly_more_than_in_the_smallest_file_of_opencv(noise):
    draw = np.random.default_rng(0)
    slope = np.add.outer(np.arange(240), np.arange(320)) / 4 + draw.normal(0, noise, (240, 320))
    levels = slope.clip(0, 255).astype(np.uint8)
    how = (
        *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_PAETH),
        *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
    )
    least = len(cv2.imencode(".png", levels, how)[1])
    assert len(pngs.encode_levels(levels)) < 1.05 * least
