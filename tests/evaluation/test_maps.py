"""Where pixels go wrong over a drive, and what a step changed."""

import numpy as np

from roadeval.evaluation.maps import Change, HeatMap, Maps, change

from .making import pixels

TRUTH = pixels("##..", "##.?")


def test_a_heat_map_counts_false_positives_and_negatives_pixel_by_pixel():
    heat = HeatMap()
    heat.add(pixels("#..#", "##.#"), TRUTH)
    heat.add(pixels("#..#", "##.."), TRUTH)
    assert heat.fp.tolist() == [[0, 0, 0, 2], [0, 0, 0, 0]]
    assert heat.fn.tolist() == [[0, 2, 0, 0], [0, 0, 0, 0]]
    assert heat.labelled[1].tolist() == [2, 2, 2, 0]


def test_a_share_is_of_the_frames_that_label_the_pixel_and_undefined_where_none_does():
    heat = HeatMap()
    heat.add(pixels("...#", "...."), TRUTH)
    heat.add(pixels("....", "...."), TRUTH)
    share = heat.share(heat.fp)
    assert share[0, 3] == 0.5
    assert np.isnan(share[1, 3])


def test_a_frame_of_another_size_is_left_out_and_counted():
    heat = HeatMap()
    heat.add(TRUTH % 2, TRUTH)
    heat.add(pixels("#"), pixels("#"))
    assert (heat.frames, heat.left_out) == (1, 1)


def test_a_change_tells_the_newly_right_from_the_newly_wrong_and_counts_no_ignored_pixel():
    before, after = pixels("#..#", "##.."), pixels("##..", ".#.#")
    assert change(before, after, TRUTH) == Change(repaired=2, spoiled=1, labelled=7)


def test_maps_follow_a_mask_from_stage_to_stage_and_variant_to_variant():
    maps = Maps()
    good, bad = pixels("##..", "##.."), pixels("#...", "##..")
    masks = {"filtered": {"svm": bad, "post": good}, "unfiltered": {"svm": bad, "post": bad}}
    maps.add(TRUTH, masks)
    assert maps.changes["filtered", "svm", "post"] == Change(1, 0, 7)
    assert maps.changes["unfiltered", "svm", "post"] == Change(0, 0, 7)
    assert maps.paired["filtered", "unfiltered"] == Change(1, 0, 7)
    assert maps.paired["unfiltered", "filtered"] == Change(0, 1, 7)
    assert maps.heat["filtered"].fn.sum() == 0
    assert maps.heat["unfiltered"].fn.sum() == 1
