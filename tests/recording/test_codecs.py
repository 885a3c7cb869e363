"""What comes back of a layer of each kind."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import rerun as rr
from PIL import Image

from roadeval.data import ERRORS, TRUTH, LayerKind, LayerSpec
from roadeval.images import Limits, to_labels
from roadeval.recording.codecs import codec, codecs_of
from roadeval.recording.layout import CAMERA, SHADOW_TRUTH
from tests.recording.making import NDI, POST, RINGS, layout

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


@pytest.mark.parametrize("spec", [ERRORS, TRUTH])
def test_a_mask_is_a_picture_in_its_classes_colours(spec):
    array = np.array([[each.value for each in spec.classes]], np.uint8)
    with Image.open(BytesIO(codec(spec, array.shape[1], 1).encode(array))) as picture:
        drawn = np.array(picture.convert("RGBA"))
    assert drawn.tolist() == [[list(each.rgba) for each in spec.classes]]


def test_the_value_for_ignored_pixels_comes_back():
    array = np.full((HEIGHT, WIDTH), 255, np.uint8)
    np.testing.assert_array_equal(there_and_back(RINGS, array), array)


def test_every_code_of_a_number_map_comes_back():
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    np.testing.assert_allclose(there_and_back(NDI, codes), codes / 127.5 - 1, atol=1e-6)


def test_an_exact_number_map_comes_back_to_the_nearest_of_256_levels():
    ndi = DRAW.uniform(-1, 1, (HEIGHT, WIDTH)).astype(np.float32)
    back = there_and_back(NDI, ndi)
    assert back.dtype == np.float32
    assert np.abs(back - ndi).max() <= 1 / 255 + 1e-6


def test_numbers_outside_their_range_are_clipped():
    outside = np.array([[-7.0, 7.0], [-1.0, 1.0]], np.float32)
    np.testing.assert_allclose(there_and_back(NDI, outside), [[-1, 1], [-1, 1]], atol=1e-6)


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


def test_an_exact_image_comes_back_equal():
    image = DRAW.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    spec = LayerSpec("aligned", LayerKind.RGB, "")
    np.testing.assert_array_equal(there_and_back(spec, image), image)


def test_what_need_not_be_exact_takes_less_than_half():
    noise = DRAW.integers(0, 256, (480, 640)).astype(np.uint8)
    sizes = [len(codec(spec, 640, 480).encode(noise)) for spec in (NDI, replace(NDI, exact=False))]
    assert sizes[1] < sizes[0] / 2


@pytest.mark.parametrize("kind", [LayerKind.SCALAR, LayerKind.RGB])
def test_what_need_not_be_exact_has_half_the_resolution_rounded_up(kind):
    spec = LayerSpec("it", kind, "", value_range=(0.0, 1.0), exact=False)
    for width, half in ((640, 320), (641, 321)):
        shape = (480, width, 3) if kind is LayerKind.RGB else (480, width)
        payload = codec(spec, width, 480).encode(np.zeros(shape, np.uint8))
        with Image.open(BytesIO(payload)) as picture:
            assert picture.size == (half, 240)


@pytest.mark.parametrize("spec", [POST, NDI, LayerSpec("aligned", LayerKind.RGB, "")])
def test_a_damaged_picture_is_refused(spec):
    chosen = codec(spec, WIDTH, HEIGHT)
    shape = (HEIGHT, WIDTH, 3) if spec.kind is LayerKind.RGB else (HEIGHT, WIDTH)
    payload = bytearray(chosen.encode(np.ones(shape, np.uint8)))
    payload[len(payload) // 2] ^= 1
    with pytest.raises(ValueError, match="a damaged PNG"):
        chosen.decode(bytes(payload))


def test_labels_are_logged_as_one_byte_a_pixel_and_hide_what_lies_below():
    told = {
        batch.component_descriptor().component: batch.as_arrow_array().to_pylist()[0]
        for style in codec(RINGS, WIDTH, HEIGHT).style()
        for batch in style.as_component_batches()
    }
    assert told["SegmentationImage:opacity"] == 1
    assert told["SegmentationImage:format"] == {
        "width": WIDTH,
        "height": HEIGHT,
        "pixel_format": None,
        "color_model": rr.ColorModel.L.value,
        "channel_datatype": rr.ChannelDatatype.U8.value,
    }


def test_the_camera_is_drawn_below_every_layer():
    def order(codec):
        orders = [
            batch.as_arrow_array().to_pylist()[0]
            for style in codec.style()
            for batch in style.as_component_batches()
            if batch.component_descriptor().component.endswith(":draw_order")
        ]
        return orders[0] if orders else None

    codecs = codecs_of(layout())
    camera = order(codecs.pop(CAMERA))
    orders = {path: order(codec) for path, codec in codecs.items()}
    assert all(above > camera for above in orders.values() if above is not None)
    assert None not in (orders["/filtered/post"], orders["/truth"])


def test_a_number_map_that_need_not_be_exact_has_each_fifth_level_alone():
    spec = replace(NDI, exact=False)
    codes = np.repeat(np.repeat(np.arange(256, dtype=np.uint8)[None], 2, axis=0), 2, axis=1)
    with Image.open(BytesIO(codec(spec, 512, 2).encode(codes))) as picture:
        levels = np.array(picture)
    np.testing.assert_array_equal(levels[0], np.rint(np.arange(256) / 5) * 5)


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
