"""Which pixels belong to which region."""

import numpy as np

from roadeval.data import TruthBits
from roadeval.evaluation import regions
from roadeval.evaluation.region import LabelledFrame
from roadeval.evaluation.regions.standard import boundary, row_bands
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels, unpacked


def boundary_of(truth, width):
    return unpacked(boundary(TruthBits.of(truth), width), truth.shape[1])


def bands_of(shape, bands):
    packed = row_bands(shape, bands).items()
    return {name: unpacked(bits, shape[1]) for name, bits in packed}


def of_frame(frame, bands, variants=()):
    settings = EvaluationSettings(boundary_width=1, bands=bands)
    labelled = LabelledFrame(frame, TruthBits.of(frame.truth), variants, settings)
    found = regions.of_frame(labelled).items()
    return {name: unpacked(bits, frame.truth.shape[1]) for name, bits in found}


def test_the_boundary_lies_within_its_width_on_both_sides_of_the_edge() -> None:
    truth = pixels("...####", "...####")
    assert (boundary_of(truth, 1) == pixels("..##...", "..##...")).all()
    assert (boundary_of(truth, 2) == pixels(".####..", ".####..")).all()


def test_the_boundary_turns_corners() -> None:
    truth = pixels("....", ".#..", "....", "....")
    assert (boundary_of(truth, 1) == pixels("###.", "###.", "###.", "....")).all()


def test_bands_go_from_top_to_bottom_and_share_the_rows() -> None:
    bands = bands_of((7, 2), 5)
    assert list(bands) == ["band_0", "band_1", "band_2", "band_3", "band_4"]
    assert sum(bands.values()).tolist() == [[1, 1]] * 7
    rows = [int(np.count_nonzero(band[:, 0])) for band in bands.values()]
    assert sum(rows) == 7
    assert max(rows) - min(rows) <= 1
    assert bands["band_0"][0, 0] == bands["band_4"][6, 0] == 1


def test_a_region_is_the_same_for_all_variants() -> None:
    mask, first, second = pixels("#."), pixels("##"), pixels("..")
    with_filter = a_variant("filtered", {"post": mask}, {"shadow": first})
    another = a_variant("gated", {"post": mask}, {"shadow": second, "lit": second})
    unfiltered = a_variant("unfiltered", {"post": mask})
    found = of_frame(a_frame(mask), 1, (unfiltered, with_filter, another))
    assert list(found)[:2] == ["shadow", "lit"]
    assert (found["shadow"] == first).all()
    assert (found["lit"] == second).all()


def test_a_frame_has_true_shadow_only_if_the_log_has_it() -> None:
    truth = pixels("##..")
    every = {"boundary", "interior", "band_0", "band_1"}
    found = of_frame(a_frame(truth), 2)
    assert set(found) == every
    shadowed = a_frame(truth, shadow=pixels("#.?#"))
    found = of_frame(shadowed, 2)
    assert set(found) == every | {"true_shadow"}
    assert (found["true_shadow"] == pixels("#..#")).all()


def test_regions_of_one_family_make_up_a_frame():
    found = of_frame(a_frame(pixels("##..", "#...")), 2, ())
    for family in (regions.HALVES, ("band_0", "band_1")):
        assert (sum(found[name] for name in family) == 1).all()
