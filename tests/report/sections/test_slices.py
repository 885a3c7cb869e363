"""When a mask fails: what a report says of slices that hold, of none, and of too few frames."""

import json
from dataclasses import replace

import pytest

from roadeval.evaluation.stats.slices import FrameCondition, Slice
from roadeval.report.blocks import Heading, Table, Text
from roadeval.report.sections.slices import when_it_fails
from roadeval.results.facts import Facts, FrameAccount
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import SCORED
from tests.report.making import plain_rows, some_findings, the
from tests.results.fleet.making import fleet_of
from tests.results.making import facts_of

SHADE = Slice(
    *([FrameCondition("shadow", ">", 0.3)], "20-80m", 45, 0.31, 0.1, 3.1, 1.8, 4.9, 0.01, [12, 40])
)


def blocks(frames: int = 90, level: int = 1, **slices: list[Slice]):
    account = FrameAccount(evaluated=frames)
    return [*when_it_fails(some_findings(slices=slices, frames=account), level)]


def test_a_slice_is_a_sentence_a_row_and_links_to_its_worst_frames():
    section = blocks(filtered=[SHADE])
    assert section[1].text == (
        "In frames with more than 30 % shade, 20 to 80 m ahead, ERR is 3.1 times the rest "
        "(1.8 to 4.9)."
    )
    place = "in frames with more than 30 % shade, 20 to 80 m ahead"
    row = [place, "45", "31.00", "10.00", "3.1 (1.8 to 4.9)", "12, 40"]
    assert plain_rows(the(Table, section)) == [row]
    assert the(Table, section).rows[0][-1].frames == [12, 40]
    assert not the(Table, blocks(level=2, filtered=[SHADE])).rows[0][-1].frames


@pytest.mark.parametrize(
    ("frames", "slices", "begin"),
    [(90, {"filtered": []}, "Nothing is confirmed."), (39, {}, "Too little")],
)
def test_where_no_slice_holds_a_sentence_says_so(frames, slices, begin):
    heading, sentence = blocks(frames, **slices)
    assert isinstance(heading, Heading)
    assert isinstance(sentence, Text)
    assert sentence.text.startswith(begin)


def test_a_result_in_which_nothing_was_searched_has_no_section():
    assert blocks(90) == []


@pytest.mark.parametrize("slices", [{}, {"mine": []}, {"mine": [SHADE, replace(SHADE, part="")]}])
def test_slices_are_read_back_as_they_were_written(slices):
    facts = Facts.parse(facts_of(slices=slices).text(), "here")
    assert facts.slices == slices
    assert ("slices" in json.loads(facts.text())) == bool(slices)


def test_drives_of_one_day_count_as_one(tmp_path):
    fleet = FleetFolder(fleet_of(tmp_path / "week", 14, status=lambda _: SCORED))
    fleet.drives["group"] = fleet.drives["drive"]
    assert [*when_it_fails(fleet)] == []  # made before conditions were measured
    fleet.drives["group"] = "monday"
    _, sentence = when_it_fails(fleet)
    assert sentence.text.startswith("Too little")
    assert sentence.text.endswith("needs 12 groups of drives.")
