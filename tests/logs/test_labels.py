"""What the values of a label image mean."""

import numpy as np
import pytest

from roadeval.logs import LabelValues, LogError
from roadeval.logs.labels import understand
from roadeval.logs.messages import BadMessage


def truth(values: list[int], labels: LabelValues | None = None) -> list[int]:
    table = understand(labels or LabelValues(), values, "/labels")
    return table.of_values(np.array([values], np.uint8))[0].tolist()


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0, 255], [0, 1]),
        ([0, 128, 255], [0, 255, 1]),
        ([0, 1], [0, 1]),
        ([0, 1, 255], [0, 1, 255]),
        ([0], [0]),
    ],
)
def test_a_mask_is_understood_by_itself(values: list[int], expected: list[int]) -> None:
    assert truth(values) == expected


def test_class_ids_are_asked_for_with_the_values_seen() -> None:
    with pytest.raises(LogError, match=r"/labels holds the values 0 3 11: .*--road-label"):
        truth([0, 3, 11])


def test_given_values_become_road_and_ignore_and_all_others_non_road() -> None:
    labels = LabelValues(road=(3, 4), ignore=(11,))
    assert truth([0, 3, 4, 11, 255], labels) == [0, 1, 1, 255, 0]


def test_a_sixteen_bit_value_is_understood() -> None:
    table = understand(LabelValues(road=(300,)), [0, 300], "/labels")
    assert table.of_values(np.array([[0, 300, 44]], np.uint16)).tolist() == [[0, 1, 0]]


@pytest.mark.parametrize(
    ("labels", "option"),
    [
        (LabelValues(road=(7,)), "--road-label 7"),
        (LabelValues(road=(3,), ignore=(9,)), "--ignore-label 9"),
    ],
)
def test_a_given_value_that_never_occurs_is_refused(labels: LabelValues, option: str) -> None:
    with pytest.raises(LogError, match=rf"{option} does not occur in /labels.* 0 3"):
        truth([0, 3], labels)


def test_a_value_cannot_mean_both() -> None:
    with pytest.raises(LogError, match="label 3 cannot mean road and ignore"):
        LabelValues(road=(3,), ignore=(3,))


def test_a_mask_that_later_holds_another_value_is_not_guessed_at() -> None:
    table = understand(LabelValues(), [0, 255], "/mask")
    with pytest.raises(BadMessage, match="holds the value 7"):
        table.of_values(np.array([[0, 7]], np.uint8))
