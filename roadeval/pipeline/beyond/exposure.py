"""Exposure and white balance: the ground in front of the vehicle gets the same grey in each frame.

Pixels brighter than the patch are compressed and not clipped, so that they keep their differences
if the patch lies in the shade or on a dark vehicle.
"""

from __future__ import annotations

from typing import Final

from roadeval.data import Layer, LayerKind, LayerSpec
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.scene import expose_by_patch
from roadeval.pipeline.stage import NoSettings, Output, Stage, View, per_view

EXPOSED: Final = LayerSpec("exposed", LayerKind.RGB, "Exposure by the reference patch", exact=False)


@per_view
def bind(_settings: NoSettings, _learnt: None, view: View) -> Output:
    """Expose the image of a view."""
    image = expose_by_patch(view.image, ReferencePatch())
    return Output((Layer(EXPOSED, image),), image=image)


STAGE: Final = Stage(
    name="exposure",
    title="Exposure by the reference patch",
    settings=NoSettings,
    bind=bind,
    layers=(EXPOSED,),
    preprocesses=True,
)
