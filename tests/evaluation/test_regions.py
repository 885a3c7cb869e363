"""Which pixels belong to which region."""

import numpy as np

from roadeval.data import TruthBits
from roadeval.evaluation import regions
from tests.evaluation.making import a_frame, a_variant, pixels, unpacked


def boundary(truth, width):
    return unpacked(regions.boundary(TruthBits.of(truth), width), truth.shape[1])


def row_bands(shape, bands):
    packed = regions.row_bands(shape, bands).items()
    return {name: unpacked(bits, shape[1]) for name, bits in packed}


def of_frame(frame, bands):
    truth = TruthBits.of(frame.truth)
    found = regions.of_frame(frame, truth, [], boundary_width=1, bands=bands).items()
    return {name: unpacked(bits, frame.truth.shape[1]) for name, bits in found}


def test_the_boundary_lies_within_its_width_on_both_sides_of_the_edge() -> None:
    truth = pixels("...####", "...####")
    assert (boundary(truth, 1) == pixels("..##...", "..##...")).all()
    assert (boundary(truth, 2) == pixels(".####..", ".####..")).all()


def test_the_boundary_turns_corners() -> None:
    truth = pixels("....", ".#..", "....", "....")
    assert (boundary(truth, 1) == pixels("###.", "###.", "###.", "....")).all()


def test_road_that_meets_ignored_pixels_has_no_edge_there() -> None:
    truth = pixels("##???..", "##???..")
    assert not boundary(truth, 1).any()


def test_a_frame_of_one_class_has_no_boundary() -> None:
    assert not boundary(pixels("###", "###"), 2).any()


def test_bands_go_from_top_to_bottom_and_share_the_rows() -> None:
    bands = row_bands((7, 2), 5)
    assert list(bands) == ["band_0", "band_1", "band_2", "band_3", "band_4"]
    assert sum(bands.values()).tolist() == [[1, 1]] * 7
    rows = [int(np.count_nonzero(band[:, 0])) for band in bands.values()]
    assert sum(rows) == 7
    assert max(rows) - min(rows) <= 1
    assert bands["band_0"][0, 0] == bands["band_4"][6, 0] == 1


def test_more_bands_than_rows_leave_some_empty() -> None:
    bands = row_bands((2, 3), 5)
    assert sum(bands.values()).tolist() == [[1, 1, 1]] * 2


def test_a_region_is_the_same_for_all_variants() -> None:
    mask, first, second = pixels("#."), pixels("##"), pixels("..")
    with_filter = a_variant("filtered", {"post": mask}, {"shadow": first})
    another = a_variant("gated", {"post": mask}, {"shadow": second, "lit": second})
    found = regions.detected([a_variant("unfiltered", {"post": mask}), with_filter, another])
    pixels_of = {name: mask.pixels().tolist() for name, mask in found.items()}
    assert pixels_of == {"shadow": first.tolist(), "lit": second.tolist()}


def test_a_frame_has_true_shadow_only_if_the_log_has_it() -> None:
    truth = pixels("##..")
    every = {"boundary", "interior", "band_0", "band_1"}
    found = of_frame(a_frame(truth), 2)
    assert set(found) == every
    shadowed = a_frame(truth, shadow=pixels("#.?#"))
    found = of_frame(shadowed, 2)
    assert set(found) == every | {"true_shadow"}
    assert (found["true_shadow"] == pixels("#..#")).all()


def test_interior_is_what_the_boundary_leaves() -> None:
    found = of_frame(a_frame(pixels("...###")), 1)
    assert (found["interior"] == pixels("##..##")).all()
