"""The words in a recording."""

from dataclasses import replace

from roadeval.recording import views
from tests.recording.making import VARIANT, layout

TOTALS = {"filtered": {"post": {"ERR": 0.25, "FPR": None, "FNR": 0.5, "pooled_ERR": 0.2}}}


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


def test_rates_stand_in_a_table_in_percent_and_undefined_ones_as_a_dash():
    text = views.results_in_words(layout(), {"totals": TOTALS})
    assert "| filtered | post | 25.00 | \N{EN DASH} | 50.00 | 20.00 |" in text


def test_what_is_quoted_of_curves_stands_in_a_table_in_percent():
    own = {"AP": 0.91, "AUC": 0.92, "MaxF": 0.93, "threshold": 0.44, "ECE": 0.05, "bins": []}
    text = views.results_in_words(layout(), {"curves": {"net": {"net": own}}})
    assert "| variant | stage | AP | AUC | MaxF | threshold | ECE |" in text
    assert "| net | net | 91.00 | 92.00 | 93.00 | 44.00 | 5.00 |" in text


def test_warnings_and_lost_parts_of_the_log_are_told():
    text = views.results_in_words(
        layout(), {"warnings": ["It collapsed."], "losses": ["3 s are lost."]}
    )
    assert "- It collapsed." in text
    assert "- 3 s are lost." in text


def test_a_summary_without_anything_gives_the_drive_alone():
    assert views.results_in_words(layout(), {}).strip() == "# street"
