"""Usual PNG files are decoded as Pillow decodes them; all others are left to it."""

import io
import struct
import zlib
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image, PngImagePlugin

from roadeval import images, kernels
from roadeval.images import png
from roadeval.images.png import decode

LIMITS = images.Limits()
RNG = np.random.default_rng(0)
KINDS = [(0, 8), (0, 16), (2, 8), (3, 1), (3, 2), (3, 4), (3, 8)]

pytestmark = pytest.mark.skipif(not kernels.are_compiled(), reason="the loops were not compiled")


def chunk(name, body=b""):
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def file(*chunks):
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def head(width, height, bits, kind, methods=(0, 0, 0)):
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, *methods))


def lines(width, height, bits, kind, filters=(0, 1, 2, 3, 4)):
    """Random filtered rows, of each filter in turn."""
    size = -(-width * bits * (3 if kind == 2 else 1) // 8)
    rows = RNG.integers(0, 256, (height, 1 + size), np.uint8)
    rows[:, 0] = np.resize(filters, height)
    return rows.tobytes()


def palette(colours=256):
    return chunk(b"PLTE", RNG.integers(0, 256, 3 * colours, np.uint8).tobytes())


def picture(width=13, height=11, bits=8, kind=3, *, filters=(0, 1, 2, 3, 4), more=b""):
    packed = zlib.compress(lines(width, height, bits, kind, filters))
    middle = [palette(1 << bits)] if kind == 3 else []
    parts = [chunk(b"IDAT", packed[a:b]) for a, b in pairwise((0, 5, 30, len(packed)))]
    return file(head(width, height, bits, kind), more, *middle, *parts, chunk(b"IEND"))


def by_pillow(data, of, monkeypatch):
    """What the public function gives where nothing but Pillow decodes."""
    with monkeypatch.context() as patch:
        patch.setattr("roadeval.images.decoding.decode", lambda *_: None)
        try:
            return of(data, LIMITS)
        except images.ImageError as error:
            return str(error)


@pytest.mark.parametrize("size", [(13, 11), (1, 1), (1, 7), (64, 2), (9, 5)])
@pytest.mark.parametrize(("kind", "bits"), KINDS)
def test_pixels_are_those_of_pillow(kind, bits, size, monkeypatch):
    data = picture(*size, bits, kind)
    assert decode(data, LIMITS) is not None
    for of in (images.to_rgb, images.to_labels, images.palette_indices):
        expected = by_pillow(data, of, monkeypatch)
        if isinstance(expected, str):
            with pytest.raises(images.ImageError, match=expected):
                of(data, LIMITS)
            continue
        found = of(memoryview(data), LIMITS)
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape)
        np.testing.assert_array_equal(found, expected)
        assert found.flags.c_contiguous


def test_labels_of_a_grey_palette_are_its_greys_and_of_a_colourful_one_its_indices():
    greys = np.repeat(np.array([0, 255, 128], np.uint8), 3)
    for colours, expected in ((greys, [0, 255, 128]), (greys + np.arange(9, dtype=np.uint8), None)):
        packed = zlib.compress(bytes([0, 0, 1, 2]))
        parts = chunk(b"PLTE", colours.tobytes()), chunk(b"IDAT", packed), chunk(b"IEND")
        data = file(head(3, 1, 8, 3), *parts)
        assert decode(data, LIMITS) is not None
        assert images.to_labels(data, LIMITS).tolist() == [expected or [0, 1, 2]]


@pytest.mark.parametrize("filters", [(each,) for each in range(5)])
def test_each_filter_is_taken_back(filters, monkeypatch):
    for kind in (0, 2):
        data = picture(40, 30, kind=kind, filters=filters)
        found = images.to_rgb(data, LIMITS)
        np.testing.assert_array_equal(found, by_pillow(data, images.to_rgb, monkeypatch))


@pytest.mark.parametrize("options", [{}, {"optimize": True}, {"compress_level": 0}])
@pytest.mark.parametrize("mode", ["L", "RGB", "P", "I;16"])
def test_what_pillow_writes_is_read(mode, options):
    levels = RNG.integers(0, 256, (30, 20, 3), np.uint8)
    if mode == "I;16":
        image = Image.fromarray(levels[..., 0].astype(np.uint16) * 257)
    else:
        image = Image.fromarray(levels).convert(mode)
    content = io.BytesIO()
    image.save(content, "PNG", **options)
    found = decode(content.getvalue(), LIMITS)
    np.testing.assert_array_equal(found.pixels, np.array(image))


DESCRIPTION = PngImagePlugin.PngInfo()
DESCRIPTION.add_text("comment", "of a camera", zip=True)


def test_descriptions_are_passed_over():
    content = io.BytesIO()
    image = Image.fromarray(RNG.integers(0, 256, (5, 4), np.uint8))
    image.save(content, "PNG", pnginfo=DESCRIPTION, dpi=(72, 72), transparency=3)
    np.testing.assert_array_equal(decode(content.getvalue(), LIMITS).pixels, np.array(image))


SOUND = zlib.compress(lines(13, 11, 8, 0))
START, END = head(13, 11, 8, 0), chunk(b"IEND")
LEFT_TO_PILLOW = {
    "no chunk": file(),
    "no pixels": file(START, END),
    "no end": file(START, chunk(b"IDAT", SOUND)),
    "bytes after the end": file(START, chunk(b"IDAT", SOUND), END) + b"x",
    "a chunk after the end": file(START, chunk(b"IDAT", SOUND), END, chunk(b"tEXt", b"a")),
    "two heads": file(START, START, chunk(b"IDAT", SOUND), END),
    "a short head": file(chunk(b"IHDR", bytes(12)), chunk(b"IDAT", SOUND), END),
    "pixels in two places": file(
        START, chunk(b"IDAT", SOUND[:9]), chunk(b"tEXt", b"a"), chunk(b"IDAT", SOUND[9:]), END
    ),
    "an unknown chunk that matters": file(START, chunk(b"NEWS"), chunk(b"IDAT", SOUND), END),
    "an animation": file(START, chunk(b"acTL", bytes(8)), chunk(b"IDAT", SOUND), END),
    "a palette after the pixels": file(head(13, 11, 8, 3), chunk(b"IDAT", SOUND), palette(), END),
    "no palette": file(head(13, 11, 8, 3), chunk(b"IDAT", SOUND), END),
    "a palette of half a colour": file(
        head(13, 11, 8, 3), chunk(b"PLTE", bytes(767)), chunk(b"IDAT", SOUND), END
    ),
    "indices beyond the palette": file(head(13, 11, 8, 3), palette(20), chunk(b"IDAT", SOUND), END),
    "pixels that end early": file(START, chunk(b"IDAT", zlib.compress(bytes(14 * 10))), END),
    "more pixels than there are": file(START, chunk(b"IDAT", zlib.compress(bytes(14 * 12))), END),
    "a stream that ends early": file(START, chunk(b"IDAT", SOUND[:-9]), END),
    "a stream without its checksum": file(START, chunk(b"IDAT", SOUND[:-4]), END),
    "bytes after the stream": file(START, chunk(b"IDAT", SOUND + b"x"), END),
    "a window that there is not": file(START, chunk(b"IDAT", b"\x88\x1c" + SOUND[2:]), END),
    "no stream": file(START, chunk(b"IDAT", b"road"), END),
    "an unknown filter": file(
        START, chunk(b"IDAT", zlib.compress(lines(13, 11, 8, 0, (0, 5)))), END
    ),
    "rows in passes": file(head(13, 11, 8, 0, (0, 0, 1)), chunk(b"IDAT", SOUND), END),
    "an unknown packing": file(head(13, 11, 8, 0, (1, 0, 0)), chunk(b"IDAT", SOUND), END),
    "grey of four bits": file(head(26, 11, 4, 0), chunk(b"IDAT", SOUND), END),
    "grey and opacity": file(head(6, 11, 8, 4), chunk(b"IDAT", SOUND), END),
    "an unknown kind of pixels": file(head(13, 11, 8, 1), chunk(b"IDAT", SOUND), END),
}


@pytest.mark.parametrize("data", LEFT_TO_PILLOW.values(), ids=LEFT_TO_PILLOW)
def test_what_is_damaged_or_rare_is_left_to_pillow(data):
    assert decode(data, LIMITS) is None


@pytest.mark.parametrize("more", [1, 2, 3, 4, 9])
@pytest.mark.parametrize("levels", [2, 256])
@pytest.mark.parametrize("effort", [0, 1, 6, 9])
def test_no_bytes_after_a_stream_are_passed_over(effort, levels, more):
    for size in range(1, 20):
        rows = np.zeros((size, 14), np.uint8)
        rows[:, 1:] = RNG.integers(0, levels, (size, 13), np.uint8)
        packed = zlib.compress(rows.tobytes(), effort)
        whole, longer = (
            file(head(13, size, 8, 0), chunk(b"IDAT", stream), END)
            for stream in (packed, packed + RNG.bytes(more))
        )
        assert decode(whole, LIMITS) is not None
        assert decode(longer, LIMITS) is None


def test_no_changed_byte_is_passed_over():
    data = picture()
    for place in range(8, len(data)):
        spoilt = bytearray(data)
        spoilt[place] ^= 1 << RNG.integers(8)
        assert decode(bytes(spoilt), LIMITS) is None
        assert decode(data[:place], LIMITS) is None


def test_chunks_without_end_are_left_to_pillow(monkeypatch):
    monkeypatch.setattr(png, "_MOST_CHUNKS", 6)
    assert decode(picture(), LIMITS) is not None
    assert decode(picture(more=chunk(b"tEXt")), LIMITS) is None


def test_an_image_that_is_too_large_is_refused_before_it_is_unpacked():
    packed = zlib.compress(bytes(1 << 20))
    data = file(head(1 << 20, 1 << 20, 8, 0), chunk(b"IDAT", packed), END)
    with pytest.raises(images.ImageError, match="more than the"):
        decode(data, LIMITS)


def test_without_compiled_kernels_pillow_decodes(monkeypatch):
    monkeypatch.setattr("roadeval.images.png.are_compiled", lambda: False)
    assert decode(picture(), LIMITS) is None
