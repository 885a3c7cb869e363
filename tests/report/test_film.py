"""The video of a page."""

import io

import av
import numpy as np
import pytest

from roadeval.report.film import CAMERA, TRUTH_PANEL, make_film


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
