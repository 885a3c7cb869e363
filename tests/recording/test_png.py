"""Label images, grey levels and colours as PNG files."""

import io
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from roadeval import images
from roadeval.data import Packed
from roadeval.recording import codecs as pngs

ROAD = [(0, 0, 0, 0), (0, 158, 115, 160)]


def decode(png):
    return images.palette_indices(png, images.Limits())


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


@pytest.mark.parametrize("values", [np.bool_, np.uint8, np.int64])
def test_a_mask_may_be_of_any_type_and_is_set_where_it_is_not_0(values):
    mask = np.random.default_rng(0).integers(0, 2, (5, 13)).astype(np.uint8)
    for inside in (1, 2, 255):
        given = (mask * np.uint8(inside)).astype(values)
        np.testing.assert_array_equal(decode(pngs.encode_labels(given, ROAD)), mask)


@pytest.mark.parametrize("classes", [3, 5, 17])
def test_labels_may_be_of_another_type(classes):
    labels = np.random.default_rng(0).integers(0, classes, (5, 13))
    png = pngs.encode_labels(labels, [(i, 0, 0, 255) for i in range(classes)])
    np.testing.assert_array_equal(decode(png), labels)


def test_another_library_sees_the_colours_and_how_opaque_they_are():
    png = pngs.encode_labels(np.array([[0, 1]], np.uint8), ROAD)
    rgba = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))
    assert [tuple(pixel) for pixel in rgba[0]] == ROAD


def test_a_mask_takes_a_bit_a_pixel_before_compression():
    noise = np.random.default_rng(0).integers(0, 2, (480, 640)).astype(np.uint8)
    assert len(pngs.encode_labels(noise, ROAD)) < noise.size / 8 * 1.05


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (7, 1), (9, 13), (9, 13, 3), (1, 1, 3)])
def test_levels_come_back_by_another_library(shape):
    levels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    png = pngs.encode_levels(levels)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png))), levels)
    read = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., ::-1] if levels.ndim == 3 else read, levels)


def test_a_row_of_levels_is_stored_as_what_the_nearest_of_three_neighbours_leaves():
    png = pngs.encode_levels(np.array([[10, 13, 13], [20, 30, 9]], np.uint8))
    # Above 30 is 13, left 20, the corner 10: 20 is nearest to 20 + 13 - 10. For 9 it is 30.
    assert list(_rows(png)) == [4, 10, 3, 0, 4, 10, 10, (9 - 30) % 256]


def test_a_row_of_labels_is_stored_without_a_filter():
    labels = np.array([[0, 1, 2], [3, 0, 1]], np.uint8)
    png = pngs.encode_labels(labels, [(i, 0, 0, 255) for i in range(4)])
    assert list(_rows(png)) == [0, 0b00_01_10_00, 0, 0b11_00_01_00]


def _rows(png):
    start = png.index(b"IDAT") + 4
    return zlib.decompress(png[start:-16])


@pytest.mark.parametrize("view", [np.asfortranarray, lambda a: a[::-1], lambda a: a[:, ::2]])
@pytest.mark.parametrize("shape", [(9, 14), (9, 14, 3)])
def test_images_may_have_any_layout(view, shape):
    levels = view(np.random.default_rng(0).integers(0, 4, shape).astype(np.uint8))
    png = pngs.encode_levels(levels)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png))), levels)
    labels = levels if levels.ndim == 2 else levels[..., 1]
    png = pngs.encode_labels(labels, [(i, 0, 0, 255) for i in range(4)])
    np.testing.assert_array_equal(decode(png), labels)


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


def test_rows_with_another_filter_are_read_as_earlier_recordings_have_them():
    labels = np.random.default_rng(0).integers(0, 2, (5, 16)).astype(np.uint8)
    packed = np.packbits(labels, axis=1)
    above = np.vstack([packed[:1], np.diff(packed, axis=0)])
    rows = b"".join(b"\2" + row.tobytes() for row in above)
    np.testing.assert_array_equal(decode(_with_rows(labels, rows)), labels)


def _with_rows(labels, rows):
    """Encode labels, and put other rows in the place of theirs."""
    png, data = pngs.encode_labels(labels, ROAD), b"IDAT" + zlib.compress(rows)
    start, end = png.index(b"IDAT") - 4, png.index(b"IEND") - 4
    length, checksum = (len(data) - 4).to_bytes(4, "big"), zlib.crc32(data).to_bytes(4, "big")
    return png[:start] + length + data + checksum + png[end:]
