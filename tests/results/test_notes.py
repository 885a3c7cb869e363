"""Notes on a frame."""

import pytest

from roadeval.data import Counts, Tally
from roadeval.evaluation import metrics
from roadeval.results.sentences import notes, notes_of


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_a_fine_frame_needs_no_note() -> None:
    finals = {"filtered": with_error(8), "unfiltered": with_error(9)}
    assert tuple(notes(finals, with_error(7))) == ()


@pytest.mark.parametrize(
    ("filtered", "unfiltered", "note"),
    [
        (20, 8, "The filter raised ERR by 12.0 pp on this frame."),
        (8, 20, "The filter lowered ERR by 12.0 pp on this frame."),
    ],
)
def test_a_large_effect_of_the_filter_is_noted(filtered: int, unfiltered: int, note: str) -> None:
    finals = {"filtered": with_error(filtered), "unfiltered": with_error(unfiltered)}
    assert tuple(notes(finals, None)) == (note,)


def test_a_failure_is_noted_with_its_reason() -> None:
    missed = metrics.of(Counts(tp=1, tn=80, fp=0, fn=19))
    assert tuple(notes({"net": missed}, None)) == ("net finds 5.0 % of the road.",)
    wrong = tuple(notes({"net": with_error(30)}, None))
    assert wrong == ("net gets 30.0 % of the pixels wrong.",)


def test_losing_to_blind_is_noted() -> None:
    assert tuple(notes({"net": with_error(14)}, with_error(7))) == (
        "net is 7.0 pp worse than blind (ERR 7.0 %).",
    )


def test_the_last_stage_of_each_variant_counts_and_blind_is_none_of_them() -> None:
    named = [("net", "svm", 40), ("net", "post", 14), ("blind", "post", 7)]
    tallies = [Tally(v, s, Counts(), rates=with_error(percent)) for v, s, percent in named]
    finals = {"net": with_error(14)}
    assert notes_of(tallies) == tuple(notes(finals, with_error(7)))
    assert notes_of(()) == ()
