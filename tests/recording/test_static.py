"""The words in a recording."""

from dataclasses import replace

from roadeval.recording import views
from tests.recording.making import VARIANT, layout


def test_the_guide_names_the_variants_that_have_a_row_and_those_that_have_a_tab():
    many = tuple(replace(VARIANT, name=name) for name in ("first", "second", "third", "fourth"))
    text = views.guide(layout(variants=many))
    assert "the phases of first and second from" in text
    assert "Those of third and fourth have tabs of their own." in text
    assert "tabs of their own" not in views.guide(layout(variants=many[:2]))


def test_without_truth_the_words_say_that_nothing_is_scored():
    text = views.guide(layout(has_truth=False))
    assert "nothing to score" in text
    assert "Errors" not in text
