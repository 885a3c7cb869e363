"""Image files to arrays; damage and size are told before anything else."""

from contextlib import suppress

import cv2
import numpy as np
import pytest

from roadeval.images.decoding import deep_samples, palette_indices, size_of, to_labels, to_rgb
from roadeval.images.formats import ImageError, Limits, format_of
from tests.images.making import (
    EXACT,
    HEIGHT,
    LOSSY,
    WIDTH,
    by_opencv,
    file,
    jpeg_of_size,
    oriented,
    png_of_size,
    scene,
    zeroed,
)

pytestmark = pytest.mark.filterwarnings("ignore:Corrupt EXIF:UserWarning")

LIMITS = Limits()
JPEG, PNG = LOSSY["JPEG"], EXACT["PNG"]


def with_byte(behind: int, value: int) -> bytes:
    """Return a JPEG with another byte behind the mark of its frame's head."""
    at = JPEG.index(b"\xff\xc0") + behind
    return JPEG[:at] + bytes([value]) + JPEG[at + 1 :]


@pytest.mark.parametrize("name", EXACT)
def test_a_format_without_loss_gives_the_same_pixels(name: str) -> None:
    np.testing.assert_array_equal(to_rgb(EXACT[name], LIMITS), scene())


@pytest.mark.parametrize("name", LOSSY)
def test_a_format_with_loss_gives_pixels_near_by(name: str) -> None:
    pixels = to_rgb(LOSSY[name], LIMITS)
    assert np.abs(pixels[40:].astype(int) - scene()[40:]).mean() < 4


@pytest.mark.parametrize("name", [*EXACT, *LOSSY])
def test_the_format_is_told_by_the_first_bytes_and_the_size_by_the_head(name: str) -> None:
    data = (EXACT | LOSSY)[name]
    format_ = format_of(data)
    assert (format_.name, format_.exact) == (name, name in EXACT)
    assert size_of(data, LIMITS) == (WIDTH, HEIGHT)


@pytest.mark.parametrize(
    "data",
    [
        *(file("JPEG", subsampling=kind) for kind in ("4:4:4", "4:2:2", "4:2:0")),
        file("JPEG", progressive=True),
        file("JPEG", restart_marker_blocks=2),
        file("JPEG", scene()[..., 0]),
        file("JPEG", np.dstack([scene(), scene()[..., :1]])[..., :3], keep_rgb=True),
        file("JPEG", exif=oriented(6)),
        JPEG + b"padding of a camera" * 300,
    ],
    ids=["444", "422", "420", "progressive", "restart", "grey", "rgb", "turned", "padded"],
)
def test_a_jpegs_pixels_are_those_of_opencv(data: bytes) -> None:
    np.testing.assert_array_equal(to_rgb(data, LIMITS), by_opencv(data))


def test_sixteen_bits_keep_the_upper_half() -> None:
    samples = np.array([[0x1234, 0xFFFF]], np.uint16)
    for format_ in ("PNG", "TIFF", "PPM"):
        data = file(format_, samples)
        assert to_rgb(data, LIMITS).tolist() == [[[0x12] * 3, [0xFF] * 3]]
        assert to_labels(data, LIMITS).tolist() == samples.tolist()


CLEAR, BLACK, WHITE = (255, 255, 255, 0), (0, 0, 0, 0), (255, 255, 255, 255)


@pytest.mark.parametrize(
    ("name", "pixels", "labels"),
    [
        ("TIFF", np.array([[70_000, -1]], np.int32), [70_000, -1]),
        ("PNG", np.array([[True, False]]), [255, 0]),
        # One colour is the mask of its opacity; two count if their opacity says the same.
        ("PNG", np.array([[CLEAR, WHITE]], np.uint8), [0, 255]),
        ("PNG", np.array([[BLACK, WHITE]], np.uint8), [0, 255]),
    ],
)
def test_labels_keep_sign_size_and_opacity(name, pixels, labels) -> None:
    assert to_labels(file(name, pixels), LIMITS).tolist() == [labels]


def test_a_label_image_whose_opacity_says_more_than_its_colours_is_refused() -> None:
    data = file("PNG", np.array([[BLACK, WHITE, CLEAR]], np.uint8))
    with pytest.raises(ImageError, match="transparent in parts: save it without"):
        to_labels(data, LIMITS)


@pytest.mark.parametrize("name", [*EXACT, *LOSSY])
def test_half_a_file_is_damaged(name: str) -> None:
    data = (EXACT | LOSSY)[name]
    with pytest.raises(ImageError, match=f"a damaged {name}"):
        to_rgb(data[: len(data) // 2], LIMITS)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (with_byte(4, 12), "a JPEG of 12 bits a sample, which is not read"),
        (with_byte(11, 0x31), "rare chroma subsampling"),
        (JPEG[:-2], "Premature end"),
        (zeroed(JPEG, 1500), r"a damaged JPEG \(Corrupt JPEG data"),
    ],
)
def test_a_jpeg_that_is_damaged_or_not_read_is_told(data: bytes, why: str) -> None:
    with pytest.raises(ImageError, match=why):
        to_rgb(data, LIMITS)


@pytest.mark.parametrize("at", [20, 50, len(PNG) // 2, len(PNG) - 14])
def test_a_flipped_bit_of_a_png_is_told_wherever_it_lies(at: int) -> None:
    data = bytearray(PNG)
    data[at] ^= 8
    with pytest.raises(ImageError, match="a damaged PNG"):
        to_rgb(bytes(data), LIMITS)


def test_a_png_of_sixteen_bits_that_lacks_rows_is_damaged() -> None:
    # Its checksums are right: nothing but the number of rows tells.
    for channels in (3, 4):
        encoded = cv2.imencode(".png", np.zeros((5, 4, channels), np.uint16))[1].tobytes()
        data = png_of_size(4, 6, encoded)
        for read in (to_rgb, deep_samples):
            with pytest.raises(ImageError, match="a damaged PNG"):
                read(data, LIMITS)


@pytest.mark.parametrize("data", [b"", b"no image", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_image_is_refused(data: bytes) -> None:
    for read in (to_rgb, to_labels, palette_indices):
        with pytest.raises(ImageError):
            read(data, LIMITS)


@pytest.mark.parametrize("data", [jpeg_of_size(30_000, 30_000), png_of_size(30_000, 30_000)])
def test_a_size_is_refused_before_anything_is_decoded(data: bytes) -> None:
    for read in (to_rgb, to_labels):
        with pytest.raises(ImageError, match=r"30000x30000, more than the 33554432 pixels"):
            read(data, LIMITS)


def test_the_limit_on_pixels_is_inclusive() -> None:
    assert to_rgb(JPEG, Limits(WIDTH * HEIGHT)).shape == (HEIGHT, WIDTH, 3)
    with pytest.raises(ImageError, match=r"`frames\.max_pixels`"):
        to_rgb(JPEG, Limits(WIDTH * HEIGHT - 1))


def test_libraries_print_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    for name, data in (EXACT | LOSSY).items():
        for broken in (data[: len(data) // 2], zeroed(data, len(data) // 3, 100)):
            with suppress(ImageError):
                to_rgb(broken, LIMITS)
        assert capfd.readouterr() == ("", ""), name


def test_a_jpeg_of_very_many_scans_is_refused_before_it_is_decoded() -> None:
    scan = bytes([0xFF, 0xDA, 0, 8, 1, 1, 0, 1, 63, 0, 0])  # refines luma by nothing
    progressive = file("JPEG", progressive=True)
    for read in (to_rgb, to_labels):
        with pytest.raises(ImageError, match="a JPEG of more than 100 scans"):
            read(memoryview(progressive[:-2] + 100 * scan + progressive[-2:]), LIMITS)
