"""What the viewer shows when a recording is opened."""

from dataclasses import replace

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


def test_a_third_variant_has_its_errors_on_the_overview_but_no_row():
    network = replace(UNFILTERED, name="network")
    overview = paths(shown(variants=(FILTERED, UNFILTERED, network))["Overview"])
    assert "/network/errors" in overview
    assert "/unfiltered/svm" in overview
    assert "/network/svm" not in overview


# --- The words in a recording ---------------------------------------------------------------------


def test_the_guide_names_the_variants_that_have_a_row_and_those_that_have_a_tab():
    many = tuple(replace(VARIANT, name=name) for name in ("first", "second", "third", "fourth"))
    text = views.guide(layout(variants=many))
    assert "the phases of first and second from" in text
    assert "Those of third and fourth have tabs of their own." in text
    assert "tabs of their own" not in views.guide(layout(variants=many[:2]))
