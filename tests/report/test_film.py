"""The video of a page."""

import io

import av
import numpy as np
import pytest

from roadeval.report.film import CAMERA, TRUTH_PANEL, clip_picture, encode, make_film
from roadeval.report.images import LayerImage


@pytest.mark.parametrize("size", [(1, 1), (17, 33), (1, 3000)])
def test_images_of_any_size_make_a_video(size):
    images = {CAMERA: np.full((*size, 3), 90, np.uint8), TRUTH_PANEL: np.zeros(size, np.uint8)}
    film = make_film([4, 7], [*images], lambda _: images, 60_000)
    with av.open(io.BytesIO(film.content)) as video:
        pictures = [frame.to_ndarray(format="gray") for frame in video.decode(video=0)]
    assert len(pictures) == 2
    assert all(picture.shape == (film.height, 2 * film.width) for picture in pictures)


def test_edges_of_the_truth_do_not_turn_into_ignored_pixels():
    truth = np.kron(np.indices((31, 31)).sum(axis=0) % 2, np.ones((25, 25))).astype(np.uint8) * 255
    images = {CAMERA: np.full((*truth.shape, 3), 90, np.uint8), TRUTH_PANEL: truth}
    film = make_film([0], [*images], lambda _: images, 10**6)
    with av.open(io.BytesIO(film.content)) as video:
        (picture,) = (frame.to_ndarray(format="rgb24") for frame in video.decode(video=0))
    shades = picture[:, film.width :, 0]
    assert np.mean((shades > 63) & (shades < 192)) < 0.01


@pytest.mark.parametrize("panels", [1, 2])
@pytest.mark.parametrize(("height", "width"), [(9, 17), (240, 320), (241, 961), (1200, 1920)])
def test_clips_of_images_of_any_size_are_960_to_1920_pixels_across(height, width, panels):
    image, name = np.full((height, width, 3), 90, np.uint8), "a name that is far too long " * 9
    truth = np.ones((height, width), np.uint8)
    picture = clip_picture([LayerImage(name, image)] * panels, truth, "drive")
    content = encode([picture], "mp4", 2, {})
    with av.open(io.BytesIO(content)) as video:
        (frame,) = video.decode(video=0)
    assert 960 <= frame.width <= 1920
    assert frame.height == pytest.approx(48 + height * frame.width / (width * panels), abs=1)


def test_equal_pictures_give_equal_films():
    images = {CAMERA: np.full((8, 8, 3), 90, np.uint8)}
    one, other = (make_film([0, 1], [CAMERA], lambda _: images, 60_000) for _ in range(2))
    assert one.content == other.content
