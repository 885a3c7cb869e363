"""What the viewer shows when a recording is opened."""

from dataclasses import replace

import pytest
import rerun as rr

from roadeval.data import LabelClass, LayerKind, LayerSpec, VariantLayout, mask_spec
from roadeval.recording import views
from tests.recording.making import NDI, POST, RINGS, VARIANT, layout

SHADOW = LayerSpec("shadow", LayerKind.MASK, "Shadow", (LabelClass(0, "lit", (0, 0, 0, 0)),))
SVM = mask_spec("svm", "SVM")
FILTERED = VariantLayout("filtered", "", ("svm", "post"), (NDI, SHADOW, RINGS, SVM, POST))
UNFILTERED = VariantLayout("unfiltered", "", ("svm", "post"), (SVM, POST))


def shown(**changes):
    """The views of every tab: by the tab's name, each view's name with its paths."""
    root = views.arrange({"": layout(**changes)}).root_container
    return {tab.name: dict(views_in(tab)) for tab in root.contents}


def views_in(part):
    if isinstance(part, rr.blueprint.View):
        yield part.name, part.contents
    else:
        for inner in part.contents:
            yield from views_in(inner)


def paths(tab):
    return {path for contents in tab.values() for path in contents}


def test_the_overview_shows_camera_truth_errors_phases_and_rates():
    overview = shown()["Overview"]
    assert {"Camera", "Truth: road", "filtered: errors", "ndi", "post"} < set(overview)
    assert "/metrics/filtered/post/ERR" in paths(overview)
    assert "/metrics/blind/post/ERR" in paths(overview)


def test_without_truth_nothing_asks_for_it():
    every = {path for tab in shown(has_truth=False).values() for path in paths(tab)}
    assert not any(path.startswith(("/truth", "/metrics", "/counts")) for path in every)
    assert not any(path.endswith("/errors") for path in every)
    assert "/timing/filtered/**" in every


def test_masks_are_drawn_over_the_camera_and_maps_alone():
    overview = shown()["Overview"]
    assert overview["post"] == ["/camera", "/filtered/post"]
    assert overview["ndi"] == ["/filtered/ndi"]


def test_rings_join_their_shadow_but_every_stages_mask_has_its_own_picture():
    overview = shown(variants=(FILTERED,))["Overview"]
    assert overview["shadow + rings"] == ["/camera", "/filtered/shadow", "/filtered/rings"]
    assert overview["svm"] == ["/camera", "/filtered/svm"]


@pytest.mark.parametrize("variants", [(VARIANT,), (FILTERED, UNFILTERED)])
def test_each_variant_has_a_tab_with_all_its_layers(variants):
    tabs = shown(variants=variants)
    for variant in variants:
        wanted = {f"/{variant.name}/{spec.name}" for spec in variant.layers}
        assert wanted < paths(tabs[f"{variant.name}: every layer"])


def test_a_third_variant_has_its_errors_on_the_overview_but_no_row():
    network = replace(UNFILTERED, name="network")
    overview = paths(shown(variants=(FILTERED, UNFILTERED, network))["Overview"])
    assert "/network/errors" in overview
    assert "/unfiltered/svm" in overview
    assert "/network/svm" not in overview


def test_true_shadow_is_shown_where_the_log_has_it():
    assert "/true_shadow" in paths(shown(has_shadow_truth=True)["filtered: every layer"])
    assert "/true_shadow" not in paths(shown()["filtered: every layer"])


@pytest.mark.parametrize(("width", "height"), [(480, 360), (1920, 400), (300, 900)])
def test_every_shape_of_image_leaves_room_for_the_curves(width, height):
    root = views.arrange({"": layout(width=width, height=height)}).root_container
    shares = root.contents[0].row_shares
    assert min(shares) > 0
    assert shares[-1] >= sum(shares) * 0.15


@pytest.mark.parametrize(("width", "height"), [(480, 360), (1920, 400)])
def test_the_rows_of_the_overview_fill_a_screen_and_no_more(width, height):
    root = views.arrange({"": layout(width=width, height=height)}).root_container
    assert sum(root.contents[0].row_shares) == pytest.approx(990)
