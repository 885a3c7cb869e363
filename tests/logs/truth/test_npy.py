"""NPY files as pictures."""

import io

import numpy as np
import pytest

from roadeval.images import ImageError, Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.truth.beside import npy_picture

LIMITS = Limits(1000)


def file_of(array, **options):
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


@pytest.mark.parametrize("dtype", ["?", "u1", "i1", "<u2", ">u2", "<i4", "<i8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_whole_numbers_keep_their_values(dtype, order):
    array = np.array([[0, 1, 1], [1, 0, 0]], dtype, order=order)
    np.testing.assert_array_equal(to_labels(npy_picture(file_of(array), LIMITS), LIMITS), array)


def test_a_number_of_sixteen_bits_keeps_them():
    array = np.array([[0, 60_000]])
    assert to_labels(npy_picture(file_of(array), LIMITS), LIMITS).tolist() == [[0, 60_000]]


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 3, 1)), r"of shape \(2, 3, 1\)"),
        (np.zeros(3), r"of shape \(3,\)"),
        (np.array([["a"]]), "not of numbers"),
        (np.array([[-1]]), "it holds -1"),
        (np.array([[70_000]]), "it holds 70000"),
        (np.zeros((1, 1), complex), "not of numbers"),
    ],
)
def test_another_array_is_refused(array, message):
    with pytest.raises(BadMessage, match=message):
        npy_picture(file_of(array), LIMITS)


def test_objects_are_refused_and_nothing_of_them_is_run():
    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("it ran",)

    with pytest.raises(BadMessage, match="not of numbers"):
        npy_picture(file_of(np.array([[Bomb()]], dtype=object), allow_pickle=True), LIMITS)


@pytest.mark.parametrize("length", [0, 5, 40, 128, 133])
def test_a_file_that_is_cut_off_is_refused(length):
    with pytest.raises(BadMessage, match=r"cut off|damaged"):
        npy_picture(file_of(np.zeros((2, 3), "u1"))[:length], LIMITS)


def test_a_head_that_claims_too_much_is_refused_before_anything_is_read():
    head = file_of(np.zeros((1, 1), "u1")).replace(b"(1, 1), }", b"(9999, 9999), }")
    with pytest.raises(ImageError, match="more than the 1000 pixels"):
        npy_picture(head, LIMITS)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0])
def test_a_fraction_that_is_no_confidence_is_refused(value):
    with pytest.raises(BadMessage, match="neither a class nor a confidence"):
        npy_picture(file_of(np.array([[0.5, value]])), LIMITS)
