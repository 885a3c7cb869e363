"""Which settings a model depends on: each stage says it of its own, and nobody else names one."""

import dataclasses

import pytest

from roadeval.pipeline.chain import STAGES
from roadeval.training.plan import Plan


def test_what_a_stage_declares_to_decide_alone_is_left_out(monkeypatch):
    another = dataclasses.replace(STAGES["svm"], name="another", deciding=("gamma", "c"))
    monkeypatch.setitem(STAGES, "another", another)
    kept = Plan(("another", "post"), {"another": another.settings()}).relevant()
    assert {name: set(own) for name, own in kept.items()} == {
        "another": {"kernel", "standardise", "threshold"}
    }


@pytest.mark.parametrize("stage", STAGES.values(), ids=STAGES)
def test_what_decides_is_a_setting_of_a_stage_that_learns(stage):
    settings = {entry.name for entry in dataclasses.fields(stage.settings)}
    assert settings >= set(stage.deciding)
    assert stage.fit is not None or not stage.deciding
