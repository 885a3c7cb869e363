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
