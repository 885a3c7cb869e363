"""A few frames, evenly over a drive, kept small."""

import numpy as np
import pytest

from roadeval.data import FINAL_STAGE, FrameResult, Role
from roadeval.jobs.run.replay import SHOWN, ExampleFrames
from tests.evaluation.making import a_frame, a_variant


def passed(total, roles, shape=(4, 6)):
    """The frames kept of a drive whose frames have these roles, and "lost" ones never came."""
    examples, mask = ExampleFrames(total), np.ones(shape, np.uint8)
    for number, role in enumerate(roles):
        if role != "lost":
            variants = (a_variant("filtered", {FINAL_STAGE: mask}),)
            examples.offer(number + 1, FrameResult(a_frame(mask, number), role, variants))
    return examples.kept


def test_frames_lie_evenly_over_the_drive():
    examples = passed(80, [Role.EVALUATED] * 80)
    assert len(examples) == SHOWN
    assert [example.frame for example in examples] == [9, 29, 49, 69]


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, "lost"])
def test_where_none_can_be_shown_the_next_one_is(role):
    examples = passed(80, [Role.EVALUATED] * 25 + [role] * 20 + [Role.EVALUATED] * 35)
    assert [example.frame for example in examples] == [9, 45, 49, 69]


def test_frames_of_a_short_drive_are_shown_once():
    examples = passed(2, [Role.EVALUATED] * 2)
    assert [example.frame for example in examples] == [0, 1]


def test_what_is_kept_is_as_small_as_it_is_drawn():
    for example in passed(4, [Role.EVALUATED] * 4, (605, 1200)):
        assert example.image.shape == (202, 400, 3)
        assert example.truth.shape == example.masks["filtered"].shape == (202, 400)
