"""What is counted, pixel by pixel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.metrics import confusion_matrix

from roadeval.data import Counts, Packed, TruthBits
from roadeval.evaluation.score import counts
from roadeval.evaluation.score.counts import error_map
from tests.evaluation.making import pixels

TRUTH = pixels("##..", "##.?")


def count(masks, truth, regions):
    """Count masks and regions that are not packed yet."""
    packed = TruthBits.of(truth)
    inside = packed.bits_of(map(Packed.of, regions.values()))
    counted = counts.count(packed.bits_of(map(Packed.of, masks)), packed, list(inside))
    for rows in counted.tolist():
        whole, *parts = (Counts(*row) for row in rows)
        yield whole, dict(zip(regions, parts, strict=True))


MASK = pixels("#.#.", "####")


@pytest.mark.parametrize("odd", [pixels("##", "##", "##", "##"), pixels("####")])
def test_another_shape_is_refused_even_with_as_many_pixels(odd: np.ndarray) -> None:
    with pytest.raises(ValueError, match="shape"):
        list(count([odd], TRUTH, {}))
    with pytest.raises(ValueError, match="shape"):
        list(count([MASK], TRUTH, {"odd": odd}))


images = st.tuples(st.integers(1, 9), st.integers(1, 30)).flatmap(
    lambda shape: st.tuples(
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1, 255])),
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1])),
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1])),
    )
)


@given(images)
def test_counts_equal_scikit_learns_confusion_matrix(
    example: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    truth, mask, region = example
    ((whole, parts),) = count([mask], truth, {"region": region})
    for found, inside in ((whole, truth != 255), (parts["region"], region == 1)):
        known = inside & (truth != 255)
        if known.any():
            table = confusion_matrix(truth[known], mask[known], labels=[0, 1])
            tn, fp, fn, tp = table.ravel().tolist()
            assert found == Counts(tp, tn, fp, fn)
        else:
            assert found == Counts()


def test_the_error_map_names_each_outcome() -> None:
    layer = error_map(MASK, TRUTH)
    names = {label.value: label.name for label in layer.spec.classes}
    assert [[names[value] for value in row] for row in layer.array.tolist()] == [
        ["TP", "FN", "FP", "TN"],
        ["TP", "TP", "FP", "ignored"],
    ]
