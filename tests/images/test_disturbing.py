"""Disturbed images: formulas held against plain ones, other libraries, and their own claims."""

import io

import numpy as np
import pytest
from PIL import Image

from roadeval.errors import SettingError
from roadeval.images.disturbing import BUILT_IN, Disturbance, assumed_depth, to_codes, to_light
from tests.fixtures.drives import scene

IMAGE = np.ascontiguousarray(scene(3)[0].repeat(2, 0).repeat(2, 1))
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
