import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from tests.pipeline.images import mask

shares = st.floats(0, 1)
rows = st.tuples(shares, shares).filter(lambda pair: pair[0] < pair[1])
patches = st.builds(lambda pair, *widths: ReferencePatch(*pair, *widths), rows, shares, shares)


def test_a_patch_by_hand():
    patch = ReferencePatch(top=0.5, bottom=1.0, top_width=0.25, bottom_width=0.75)
    drawn = patch_mask(5, 8, patch)
    assert (drawn == mask("........", "........", "...##...", "..####..", ".######.")).all()


@given(st.tuples(st.integers(1, 40), st.integers(1, 60)), patches)
def test_a_patch_is_symmetric_never_empty_and_as_wide_as_stated(shape, patch):
    height, width = shape
    drawn = patch_mask(height, width, patch)
    np.testing.assert_array_equal(drawn, drawn[:, ::-1])
    rows = np.flatnonzero(drawn.any(axis=1))
    assert rows[0] == round(patch.top * (height - 1))
    assert rows[-1] == round(patch.bottom * (height - 1))
    assert (np.diff(rows) == 1).all()
    assert abs(drawn[rows[0]].sum() - patch.top_width * width) <= 2
    if len(rows) > 1:
        assert abs(drawn[rows[-1]].sum() - patch.bottom_width * width) <= 2


def test_an_upside_down_patch_is_refused():
    with pytest.raises(ValueError, match="top must lie above bottom"):
        ReferencePatch(top=0.9, bottom=0.5)
