"""Another method's road masks, in the log or beside it, as a stage."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from roadeval.data import Layer, mask_spec
from roadeval.pipeline.stage import AbsentError, Output, Stage, View, per_view, stage_settings

GIVEN: Final = mask_spec("given", "Road by another method")


@stage_settings
class GivenSettings:
    """Settings of another method's masks as a stage.

    name: Variant that the masks belong to, one of ``[masks]`` or ``topics.masks``.
    """

    name: str = ""


@per_view
def bind(settings: GivenSettings, _learnt: None, view: View) -> Output:
    """Return the method's mask of the frame; an `AbsentError` if there is none."""
    output = view.external.get(settings.name)
    if output is None or output.mask is None:
        frame = f"frame {view.moment.number}" if view.moment else "the image"
        raise AbsentError(f"given: {frame} has no mask of {settings.name}")
    return replace(output, layers=(Layer(GIVEN, output.mask),))


STAGE: Final = Stage(
    name="given", title="Another method's masks", settings=GivenSettings, bind=bind, layers=(GIVEN,)
)
