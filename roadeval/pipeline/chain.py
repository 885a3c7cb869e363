"""The chain: stages by name, bound to settings and parameters, run one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from roadeval.data import LayerSpec, Rgb, Truth
from roadeval.data.packed import Packed
from roadeval.pipeline.beyond import context, exposure, gated
from roadeval.pipeline.paper import post as morphology
from roadeval.pipeline.paper import shadow, similarity
from roadeval.pipeline.paper import svm as classify
from roadeval.pipeline.stage import Output, Stage, View, perfect_mask

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
    oracle: Callable[[View, Truth], Output] | None = None


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

    def run(self, view: View) -> Iterator[tuple[str, Output]]:
        """Yield each stage's name and output on what is seen before the first.

        A stage runs when it is asked for, so that a caller can time it.
        """
        for step in self.steps:
            output = step.run(view)
            view = view.after(output)
            yield step.stage.reported, output

    def oracles(
        self,
        view: View,
        outputs: Sequence[Output],
        road: Truth,
        shadow: Truth | None,
        known: dict[Any, dict[str, Packed]],
    ) -> Iterator[tuple[str, dict[str, Packed]]]:
        """Yield what the chain makes of an image once one of its stages is replaced by the truth.

        Parameters
        ----------
        view, outputs
            What `run` was given, and gave.
        road, shadow
            The truths, ``(H, W)`` uint8 (0, 1, 255). Without that of shadow filters have none.
        known
            What the frame's other variants gave that is the same for all, filled as it is found.

        Yields
        ------
        stage, masks
            The stage that was replaced, as it is reported, and the masks of those after it.
        """
        for place, (step, output) in enumerate(zip(self.steps, outputs, strict=True)):
            truth = shadow if step.stage.is_filter else road
            if step.oracle is not None and truth is not None:
                rest = self.steps[place + 1 :]
                key = _shared(step, rest)
                masks = known.get(key) if key else None
                if masks is None:
                    masks = dict(_masks(rest, view.after(step.oracle(view, truth))))
                    known[key] = masks
                yield step.stage.reported, masks
            view = view.after(output)

    def filtered(self, image: Rgb) -> Rgb:
        """Return the image as the chain's filters leave it; itself where there are none."""
        for step in self.steps:
            if not step.stage.yields_mask:
                output = step.run(View.of(image))
                image = image if output.image is None else output.image
        return image


def _bind(stage: Stage[Any, Any], settings: Any, parameters: Mapping[str, Any]) -> Step:
    learnt = parameters.get(stage.name)
    oracle = None if stage.oracle is None else stage.oracle(settings, learnt)
    return Step(stage, settings, stage.bind(settings, learnt), oracle)


def _shared(step: Step, rest: Sequence[Step]) -> tuple[tuple[str, Any], ...]:
    """Give what the masks after a perfect stage depend on beside the truth; empty for the image."""
    if step.stage.oracle is not perfect_mask or not all(s.stage.sees_mask_alone for s in rest):
        return ()
    return tuple((each.stage.name, each.settings) for each in rest)


def _masks(steps: Sequence[Step], view: View) -> Iterator[tuple[str, Packed]]:
    for step in steps:
        output = step.run(view)
        view = view.after(output)
        if output.mask is not None:
            yield step.stage.reported, output.mask


def layers_of(names: Sequence[str], settings: Mapping[str, Any]) -> tuple[LayerSpec, ...]:
    """List the layers that a chain will hand out, in order, without running it."""
    return tuple(spec for name in names for spec in STAGES[name].layers(settings[name]))


def masks_of(names: Sequence[str]) -> tuple[str, ...]:
    """List a chain's road masks, in order, by the names that their stages are reported under."""
    stages = (STAGES[name] for name in names)
    return tuple(stage.reported for stage in stages if stage.yields_mask)


@dataclass(frozen=True, slots=True)
class Pipeline:
    """Stages in the order they run, and the settings of each."""

    chain: tuple[str, ...]
    settings: Mapping[str, Any]

    @property
    def has_filter(self) -> bool:
        """Whether some stage of the chain is a filter."""
        return any(STAGES[name].is_filter for name in self.chain)

    def without_filter(self) -> Pipeline:
        """Return the pipeline without the filters of its chain."""
        chain = tuple(name for name in self.chain if not STAGES[name].is_filter)
        return Pipeline(chain, {name: self.settings[name] for name in chain})

    def layers(self) -> tuple[LayerSpec, ...]:
        return layers_of(self.chain, self.settings)

    def masks(self) -> tuple[str, ...]:
        return masks_of(self.chain)

    def as_dict(self) -> dict[str, Any]:
        """Return the chain and its settings as plain data, in the shape of a TOML file."""
        settings = {name: asdict(self.settings[name]) for name in self.chain}
        return {"chain": list(self.chain), **settings}

    def bind(self, parameters: Mapping[str, Any]) -> Chain:
        return Chain(self.chain, self.settings, parameters)
