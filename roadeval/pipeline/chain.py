"""The chain: stages by name, bound to settings and parameters, run one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.data import LayerSpec, Rgb
from roadeval.pipeline import (
    classify,
    context,
    exposure,
    gated,
    morphology,
    shadow,
    similarity,
)
from roadeval.pipeline.stage import Moment, Output, Stage, View

STAGES: Final[Mapping[str, Stage[Any, Any]]] = {
    stage.name: stage
    for stage in (
        exposure.STAGE,
        shadow.STAGE,
        gated.STAGE,
        similarity.STAGE,
        classify.STAGE,
        context.STAGE,
        morphology.STAGE,
    )
}
"""Every stage that a configuration's ``chain`` may name."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A stage with its settings and learnt parameters, ready to run."""

    stage: Stage[Any, Any]
    settings: Any
    run: Callable[[View], Output]


class Chain:
    """Stages in the order they run.

    Parameters
    ----------
    names
        Stages, by their names in `STAGES`.
    settings
        The settings of each, by name.
    parameters
        What the stages that learn have learnt, by name.
    """

    def __init__(
        self, names: Sequence[str], settings: Mapping[str, Any], parameters: Mapping[str, Any]
    ) -> None:
        self.steps = tuple(_bind(STAGES[name], settings[name], parameters) for name in names)

    def run(self, image: Rgb, moment: Moment | None = None) -> Iterator[tuple[str, Output]]:
        """Yield each stage's name and output on an ``(H, W, 3)`` uint8 RGB image.

        A stage runs when it is asked for, so that a caller can time it. ``moment`` is the frame's
        place in its drive, for stages that remember.
        """
        seen, mask = image, None
        for step in self.steps:
            output = step.run(View(image, seen, mask, moment))
            seen = seen if output.image is None else output.image
            mask = mask if output.mask is None else output.mask
            yield step.stage.reported, output

    def filtered(self, image: Rgb) -> Rgb:
        """Return the image as the chain's filters leave it; itself where there are none."""
        for step in self.steps:
            if not step.stage.yields_mask:
                output = step.run(View(image, image))
                image = image if output.image is None else output.image
        return image


def _bind(stage: Stage[Any, Any], settings: Any, parameters: Mapping[str, Any]) -> Step:
    return Step(stage, settings, stage.bind(settings, parameters.get(stage.name)))


def layers_of(names: Sequence[str], settings: Mapping[str, Any]) -> tuple[LayerSpec, ...]:
    """List the layers that a chain will hand out, in order, without running it."""
    return tuple(spec for name in names for spec in STAGES[name].layers(settings[name]))


def masks_of(names: Sequence[str]) -> tuple[str, ...]:
    """List a chain's road masks, in order, by the names that their stages are reported under."""
    stages = (STAGES[name] for name in names)
    return tuple(stage.reported for stage in stages if stage.yields_mask)
