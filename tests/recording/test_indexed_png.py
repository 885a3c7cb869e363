"""Small label images as PNG files."""

import io
import zlib

import numpy as np
import pytest
from PIL import Image

from roadeval import images
from roadeval.data.packed import Packed
from roadeval.recording import indexed_png

ROAD = [(0, 0, 0, 0), (0, 158, 115, 160)]


def decode(png):
    return images.palette_indices(png, images.Limits())


@pytest.mark.parametrize("classes", [2, 3, 4, 5, 16, 17, 256])
@pytest.mark.parametrize("width", [1, 7, 8, 13])
def test_labels_come_back_whatever_their_number_and_the_width(classes, width):
    labels = np.random.default_rng(0).integers(0, classes, (5, width)).astype(np.uint8)
    png = indexed_png.encode(labels, [(i, 0, 0, 255) for i in range(classes)])
    np.testing.assert_array_equal(decode(png), labels)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("width", [1, 7, 8, 13, 63, 64, 65, 130])
def test_a_packed_mask_gives_the_same_file(classes, width):
    mask = np.random.default_rng(0).integers(0, 2, (5, width)).astype(np.uint8)
    palette = [(i, 0, 0, 255) for i in range(classes)]
    png = indexed_png.encode(mask, palette)
    assert indexed_png.encode(Packed.of(mask), palette) == png


def test_another_library_sees_the_colours_and_how_opaque_they_are():
    png = indexed_png.encode(np.array([[0, 1]], np.uint8), ROAD)
    rgba = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))
    assert [tuple(pixel) for pixel in rgba[0]] == ROAD


def test_a_mask_takes_a_bit_a_pixel_before_compression():
    noise = np.random.default_rng(0).integers(0, 2, (480, 640)).astype(np.uint8)
    assert len(indexed_png.encode(noise, ROAD)) < noise.size / 8 * 1.05


def test_rows_without_a_filter_are_read_as_earlier_recordings_have_them():
    labels = np.random.default_rng(0).integers(0, 2, (5, 16)).astype(np.uint8)
    rows = b"".join(b"\0" + np.packbits(row).tobytes() for row in labels)
    np.testing.assert_array_equal(decode(_with_rows(labels, rows)), labels)


def _with_rows(labels, rows):
    """Encode labels, and put other rows in the place of theirs."""
    png, data = indexed_png.encode(labels, ROAD), b"IDAT" + zlib.compress(rows)
    start, end = png.index(b"IDAT") - 4, png.index(b"IEND") - 4
    length, checksum = (len(data) - 4).to_bytes(4, "big"), zlib.crc32(data).to_bytes(4, "big")
    return png[:start] + length + data + checksum + png[end:]
