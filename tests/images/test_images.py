"""Image files to arrays; damage and size are told before anything else."""

import io
import struct
import zlib
from base64 import b85decode
from contextlib import suppress

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from roadeval.errors import SettingError
from roadeval.images import disturbing
from roadeval.images.decoding import deep_samples, palette_indices, size_of, to_labels, to_rgb
from roadeval.images.disturbing import (
    BUILT_IN,
    Disturbance,
    DisturbanceKind,
    assumed_depth,
    to_codes,
    to_light,
)
from roadeval.images.formats import ImageError, Limits, format_of
from tests.fixtures.drives import scene as road_scene
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


@pytest.mark.parametrize("greatest", [1, 18, 255, 1000, 4095, 65535])
def test_a_pgm_keeps_its_numbers_whatever_its_greatest_is(greatest: int) -> None:
    # Pillow 13.0 scales them to 8 or 16 bits.
    values = np.array([[0, 1, greatest // 2, greatest]])
    samples = values.astype(np.uint8 if greatest < 256 else ">u2").tobytes()
    file = f"P5\n# a comment\n4 1\n{greatest}\n".encode() + samples
    assert to_labels(file, Limits()).tolist() == values.tolist()
    image = to_rgb(file, Limits(), greatest if greatest > 255 else None)[..., 0]
    assert np.abs(image - 255 * (values / greatest)).max() <= 1
    deep = deep_samples(file, Limits())
    assert deep is None if greatest < 256 else deep.tolist() == values.tolist()


def tiff(pixels, **options) -> bytes:
    """Return a TIFF file by tifffile."""
    made = io.BytesIO()
    tifffile.imwrite(made, pixels, **options)
    return made.getvalue()


def grey_with_opacity(values: list[int]) -> bytes:
    """Return a PNG of one row, of grey and opacity with 16 bits; no library here writes one."""
    row = b"\0" + b"".join(struct.pack(">HH", value, 65535) for value in values)
    head = struct.pack(">IIBBBBB", len(values), 1, 16, 4, 0, 0, 0)
    parts = (b"IHDR", head), (b"IDAT", zlib.compress(row)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )


IDS = np.array([[0, 1, 7, 300]], np.uint16)
THRICE = np.repeat(IDS[..., None], 3, axis=2)


@pytest.mark.parametrize(
    "data",
    [
        cv2.imencode(".png", THRICE)[1].tobytes(),
        cv2.imencode(".png", np.dstack([THRICE, np.full_like(IDS, 65535)]))[1].tobytes(),
        grey_with_opacity(IDS[0].tolist()),
        tiff(THRICE, photometric="rgb"),
    ],
    ids=["PNG", "PNG with opacity", "PNG of grey with opacity", "TIFF"],
)
def test_labels_of_sixteen_bits_in_equal_channels_keep_their_numbers(data: bytes) -> None:
    assert to_labels(data, LIMITS).tolist() == IDS.tolist()


@pytest.mark.parametrize("factor", [256, 257])
def test_labels_of_eight_bits_that_were_stored_in_sixteen_are_the_same(factor: int) -> None:
    colours = np.array([[[0, 128, 255], [255, 255, 255]]], np.uint16)
    data = cv2.imencode(".png", colours[..., ::-1] * factor)[1].tobytes()
    assert to_labels(data, LIMITS).tolist() == colours.tolist()


def test_colours_that_eight_bits_do_not_hold_are_no_labels() -> None:
    data = cv2.imencode(".png", np.array([[[0, 1, 2], [2, 1, 0]]], np.uint16))[1].tobytes()
    with pytest.raises(ImageError, match="colours that need 16 bits: save it with 8 bits"):
        to_labels(data, LIMITS)


MASK = np.array([[1, 0, 0, 1, 1], [1, 1, 0, 0, 0]], np.uint8)


BANDS = np.stack([1 - MASK, MASK], axis=2)


def test_a_large_tiff_and_one_with_a_preview_and_an_opacity_are_read() -> None:
    # BigTIFF has offsets of 64 bits.
    big = tiff(MASK, bigtiff=True, extratags=[(274, "H", 1, 3, True)])
    assert to_labels(big, LIMITS).tolist() == MASK.tolist()
    assert to_labels(big, Limits(turn=True)).tolist() == MASK[::-1, ::-1].tolist()
    made = io.BytesIO()
    with tifffile.TiffWriter(made) as writer:
        writer.write(MASK)
        writer.write(MASK[:, ::2], subfiletype=1)
        writer.write(MASK > 0, subfiletype=4, photometric="mask")
    assert to_labels(made.getvalue(), LIMITS).tolist() == MASK.tolist()


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (tiff(MASK > 0), "by tifffile, which writes True as black"),
        (tiff(np.stack([MASK, 1 - MASK])), "a TIFF of several images"),
        (tiff(MASK.astype(np.int64)), "numbers that are not read, as 64 bits"),
        # Pillow 12 does not open it, and Pillow 13 has its first band.
        (tiff(BANDS, photometric="minisblack", planarconfig="contig"), "(2 bands|are not read)"),
    ],
    ids=["truth values", "an image a class", "64 bits", "a band a class"],
)
def test_a_tiff_that_may_be_read_otherwise_is_refused_with_the_way_out(data, problem) -> None:
    with pytest.raises(ImageError, match=f"{problem}.*: save "):
        to_labels(data, LIMITS)


def test_one_bit_whose_zero_is_white_is_read_as_it_looks() -> None:
    data = tiff(MASK == 0, photometric="miniswhite", software="another")
    assert to_labels(data, LIMITS).tolist() == (255 * MASK).tolist()


TWELVE_BITS = b85decode(
    "0000CYEU2`4GM<}0000KW^{RQYH%_j00000YH%_j0000jYH%`W0000MX=r3}0000200004009dJ0000001sntY;pkr0"
    "00005dZ)Hk7{r-WB*V8Q2;3b000001ONa40ssI200000000001ONa40ssI2000000003C0RjI~01N;C009611Oxy9|6"
    "BkBKw$r503`qcLvm$dbY)~9VtF7>aAj^vP(?=|c4cyNX>V>IGA=bPH2;tQ3IG5A0012T0soWV;4ldp=n`I|yY%Pdj("
    "`8z"
)
"""A JPEG 2000 by OpenJPEG, without loss, that states 12 bits."""


def test_a_jpeg_2000_of_twelve_bits_keeps_its_numbers() -> None:
    # Pillow 13.0 multiplies them by 16.
    samples = deep_samples(TWELVE_BITS, Limits())
    assert samples is not None
    assert samples.tolist() == [[0, 1, 2048, 4095]] * 2


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


# --- Disturbed images: formulas held against plain ones, other libraries, and their own claims ----


IMAGE = np.ascontiguousarray(road_scene(3)[0].repeat(2, 0).repeat(2, 1))
STRENGTHS = {
    "dark": (0.5, 1, 2, 4),
    "fog": (0.5, 1, 2, 4),
    "blur": (1, 2, 4, 8),
    "dirt": (0.5, 1, 2, 4),
    "rain": (0.5, 1, 2, 4),
    "jpeg": (95, 50, 20, 5),
    "noise": (0.5, 1, 2, 3),
    "exposure": (0.5, 1, 2, 4),
}


def srgb(light):
    """The codes of linear light, by the standard's formula."""
    light = np.clip(light, 0, 1)
    curve = 1.055 * light ** (1 / 2.4) - 0.055
    return 255 * np.where(light <= 0.0031308, 12.92 * light, curve)


def linear(codes):
    codes = np.asarray(codes, float) / 255
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_light_of_every_code_leads_back_to_it():
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(to_codes(to_light(codes)), codes)


@pytest.mark.parametrize("kind", [kind.name for kind in BUILT_IN if kind.name != "jpeg"])
def test_strength_0_is_the_image_bit_for_bit(kind):
    assert np.array_equal(Disturbance(kind, 0.0).of(IMAGE, 1), IMAGE)


@pytest.mark.parametrize("kind", [kind.name for kind in BUILT_IN])
def test_more_strength_changes_the_image_more_and_little_changes_little(kind):
    changes = [
        np.abs(Disturbance(kind, strength).of(IMAGE, 1).astype(int) - IMAGE).mean()
        for strength in STRENGTHS[kind]
    ]
    assert changes == sorted(changes)
    assert 0 < changes[0] < changes[-1]


@pytest.mark.parametrize("kind", [kind.name for kind in BUILT_IN])
def test_a_frame_is_disturbed_alike_again_and_only_chance_differs_between_frames(kind):
    before = IMAGE.copy()
    once, again, later = (Disturbance(kind, 2.0).of(IMAGE, frame) for frame in (1, 1, 2))
    assert np.array_equal(once, again)
    assert np.array_equal(IMAGE, before)
    assert np.array_equal(once, later) == (kind not in ("dark", "noise", "rain"))


def test_fog_is_koschmieders_law_on_the_ground():
    depth = np.full(IMAGE.shape[:2], 30, np.float32)
    light = linear(IMAGE)
    air = 0.6 * np.percentile(light[::4, ::4].mean(axis=2), 99)
    near = 1 / np.hypot(1 / 30, 1 / 80)  # what stands on the ground hides what is far
    through = 0.05 ** (near / (200 / 2))  # 5 % of the contrast is left at the visibility
    expected = srgb(light * through + air * (1 - through))
    fogged = Disturbance("fog", 2.0).of(IMAGE, 1, depth)
    assert np.abs(fogged - expected).max() < 1


def test_noise_has_the_variance_of_electrons_and_of_reading_them():
    grey = np.full((300, 300, 3), 150, np.uint8)
    noisy = linear(Disturbance("noise", 2.0).of(grey, 7))
    well = 4096 / 4
    electrons = linear(150) * well
    assert noisy.mean() == pytest.approx(linear(150), rel=0.005)
    assert noisy.var() * well**2 == pytest.approx(electrons + 3**2, rel=0.02)


def test_noise_and_jpeg_are_those_of_albumentations():
    albumentations = pytest.importorskip("albumentations")
    compress = albumentations.ImageCompression(quality_range=(20, 20), p=1)
    theirs = compress(image=IMAGE)["image"]  # it takes red for blue
    ours = Disturbance("jpeg", 20.0).of(np.ascontiguousarray(IMAGE[..., ::-1]), 1)
    assert np.array_equal(ours[..., ::-1], theirs)
    grey = np.full((300, 300, 3), 150, np.uint8)
    scale = 4 / 4096  # its light of one photon
    shot = albumentations.ShotNoise(scale_range=(scale, scale), p=1)(image=grey)["image"]
    theirs, ours = shot.astype(float), Disturbance("noise", 2.0).of(grey, 7).astype(float)
    assert ours.mean() == pytest.approx(theirs.mean(), abs=0.3)
    assert ours.std() == pytest.approx(theirs.std(), rel=0.05)


def test_jpeg_is_that_of_pillow():
    file = io.BytesIO()
    Image.fromarray(IMAGE).save(file, "JPEG", quality=20)
    pillow = np.asarray(Image.open(file)).astype(int)
    assert np.abs(Disturbance("jpeg", 20.0).of(IMAGE, 1) - pillow).max() <= 2


def test_a_stop_doubles_the_light_and_white_is_clipped():
    brighter = linear(Disturbance("exposure", 1.0).of(IMAGE, 1))
    assert np.abs(srgb(np.minimum(2 * linear(IMAGE), 1)) - srgb(brighter)).max() < 1


def test_a_point_out_of_focus_is_a_disk_with_the_light_of_the_point():
    image = np.zeros((61, 320, 3), np.uint8)
    image[30, 160] = 255
    light = linear(Disturbance("blur", 5.0).of(image, 1))[..., 0]
    rows, columns = np.nonzero(light)
    assert np.hypot(rows - 30, columns - 160).max() == pytest.approx(5, abs=0.5)
    assert light.sum() == pytest.approx(1, rel=0.05)


def test_the_ground_is_near_at_the_bottom_and_nothing_is_known_of_roofs():
    depth = assumed_depth(360, 480)[:, 0]
    horizon = int(0.45 * 360)
    assert (depth[:horizon] < 0).all()
    assert (np.diff(depth[horizon + 1 :]) < 0).all()
    assert depth[-1] == pytest.approx(1.4 * 0.8 * 480 / (359 - 0.45 * 360), rel=1e-3)


@pytest.mark.parametrize(
    ("text", "name", "shown"),
    [
        ("fog:2", "fog-2", "fog:2"),
        ("FOG:2", "fog-2", "fog:2"),
        ("blur:0.50", "blur-0_5", "blur:0.5"),
        ("exposure:+1", "exposure-plus1", "exposure:+1"),
        ("exposure:-0.5", "exposure-minus0_5", "exposure:-0.5"),
    ],
)
def test_a_disturbance_has_a_plain_name_and_the_text_that_makes_it(text, name, shown):
    disturbance = Disturbance.parse(text)
    assert (disturbance.name, str(disturbance)) == (name, shown)
    assert Disturbance.parse(shown) == disturbance


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("fogg:2", "did you mean fog"),
        ("", "choose dark, fog"),
        ("fog", "must be from 0 to 20"),
        ("jpeg:0", "from 1 to 100"),
        ("noise:-1", "from 0 to 6"),
    ],
)
def test_a_wrong_disturbance_is_told_with_what_is_allowed(text, says):
    with pytest.raises(SettingError, match=says):
        Disturbance.parse(text)


@pytest.mark.parametrize(("least", "most"), [(0, 12), (0, 1), (5, 9)])
def test_a_wrong_strength_is_told_with_an_example_that_is_allowed(least, most, monkeypatch):
    kind = DisturbanceKind("haze", "share of white", lambda image, *_: image, least, most)
    monkeypatch.setattr(disturbing, "kinds", lambda: {"haze": kind})
    with pytest.raises(SettingError) as told:
        Disturbance.parse("haze:99")
    example = str(told.value).rpartition(" as ")[2]
    assert least <= Disturbance.parse(example).strength <= most
