"""A pipeline: stages by name with their settings; and the chain that it becomes to run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from time import perf_counter
from typing import Any

from roadeval.data import LayerSpec, Output, Packed, StageResult, Truth
from roadeval.pipeline.stage import Stage, View
from roadeval.pipeline.stages import stages_of


@dataclass(frozen=True)
class Pipeline:
    """Stages in the order they run, and the settings of each.

    ``chain`` names them as `roadeval.pipeline.stages.stages_of` finds them, which need not be the
    names that they bear themselves; ``settings`` are by the latter.
    """

    chain: tuple[str, ...]
    settings: Mapping[str, Any]

    def stages(self) -> tuple[Stage, ...]:
        """Return the stages, in order."""
        return stages_of(self.chain)

    def _pairs(self) -> list[tuple[Stage, Any]]:
        """Return the stages with their settings."""
        return [(stage, self.settings[stage.name]) for stage in self.stages()]

    def layers(self) -> tuple[LayerSpec, ...]:
        """Return the layers that the stages will hand out, in order."""
        return tuple(spec for stage, own in self._pairs() for spec in stage.specs(own))

    def masks(self) -> tuple[str, ...]:
        """Return the names of the stages that make a road mask, in order."""
        return tuple(stage.name for stage in self.stages() if stage.yields_mask)

    def without_filter(self) -> Pipeline:
        """Return the pipeline without its filters."""
        pairs = zip(self.chain, self.stages(), strict=True)
        kept = {name: stage.name for name, stage in pairs if not stage.is_filter}
        return Pipeline(tuple(kept), {own: self.settings[own] for own in kept.values()})

    def learning(self) -> tuple[str, ...]:
        """Return the names of the stages that learn."""
        return tuple(stage.name for stage in self.stages() if stage.fit is not None)

    def relevant(self) -> dict[str, dict[str, Any]]:
        """Return the settings that the learnt parameters depend on, by stage.

        Those of stages that learn, change the image, or are heard, except where they are
        `inference_only` or `places`.
        """
        heard = self.heard()
        return {
            stage.name: {
                key: value
                for key, value in asdict(own).items()
                if key not in (*stage.inference_only, *stage.places)
            }
            for stage, own in self._pairs()
            if stage.fit is not None or not stage.yields_mask or stage in heard
        }

    def heard(self) -> tuple[Stage, ...]:
        """Return the stages whose masks a later one learns from; none where no stage hears any."""
        pairs = self._pairs()
        last = max((n for n, (s, own) in enumerate(pairs) if s.hears and s.hears(own)), default=0)
        return tuple(stage for stage, _ in pairs[:last] if stage.yields_mask)

    def resolved(self) -> Pipeline:
        """Return the pipeline with settings stated that its stages find in files.

        A `RoadevalError` if a file cannot be used.
        """
        found = {stage.name: stage.resolve(own) for stage, own in self._pairs() if stage.resolve}
        return replace(self, settings={**self.settings, **found})

    def without_places(self) -> Pipeline:
        """Return the pipeline without the settings that say where files lie."""
        blank = {s.name: replace(own, **dict.fromkeys(s.places, "")) for s, own in self._pairs()}
        return replace(self, settings=blank)

    def about(self) -> dict[str, dict[str, Any]]:
        """Return what results say of stages beside their settings, by stage."""
        return {stage.name: dict(stage.about(own)) for stage, own in self._pairs() if stage.about}

    def as_dict(self) -> dict[str, Any]:
        """Return the chain and its settings as plain data, in the shape of a TOML file."""
        settings = {name: asdict(own) for name, own in self.settings.items()}
        return {"chain": list(self.chain), **settings}

    def bind(self, parameters: Mapping[str, Any]) -> Chain:
        """Return the chain that runs with what the stages have learnt, by stage.

        A `MisfitError` if that does not fit the settings.
        """
        steps = []
        for stage, own in self._pairs():
            learnt = parameters.get(stage.name)
            steps.append(Step(stage, own, learnt, stage.bind(own, learnt)))
        return Chain(tuple(steps))


@dataclass(frozen=True, eq=False)
class Step:
    """A stage with its settings and learnt parameters, ready to run."""

    stage: Stage
    settings: Any
    parameters: Any
    run: Callable[[View], Output]


@dataclass(frozen=True, eq=False)
class Chain:
    """The steps of a pipeline, ready to run one after the other on an image."""

    steps: tuple[Step, ...]

    def run(
        self, view: View, shared: dict[Any, StageResult] | None = None
    ) -> Iterator[StageResult]:
        """Yield what each stage makes of what is seen before the first, and how long it took.

        A stage runs when its result is taken. ``shared`` holds what the chains of a frame have in
        common: the first stage that makes a mask and has learnt nothing, as a network that is a
        variant and is tuned in another. It runs once.
        """
        shared, seen = {} if shared is None else shared, view
        for step in self.steps:
            key = step.stage.name, step.settings
            is_shared = seen is view and step.stage.yields_mask and step.stage.fit is None
            result = shared.get(key) if is_shared else None
            if result is None:
                start = perf_counter()
                output = step.run(seen)
                result = StageResult(step.stage.name, output, perf_counter() - start)
            if is_shared:
                shared[key] = result
            yield result
            seen = seen.after(result.output)

    def oracles(
        self, view: View, outputs: Sequence[Output], road: Truth, shadow: Truth | None
    ) -> Iterator[tuple[str, dict[str, Packed]]]:
        """Yield what the chain makes of an image once one of its stages is replaced by the truth.

        ``view`` and ``outputs`` are the argument and the outputs of `run`, ``road`` and ``shadow``
        the truths, ``(H, W)`` uint8 (0, 1, 255); without that of shadow no filter is replaced.
        Yielded are the name of the stage that was replaced, and the masks of those after it.
        """
        for place, (step, output) in enumerate(zip(self.steps, outputs, strict=True), 1):
            truth = shadow if step.stage.is_filter else road
            if (oracle := step.stage.oracle) is not None and truth is not None:
                seen = view.after(oracle(step.settings, step.parameters, view, truth))
                later = Chain(self.steps[place:]).run(seen)
                masks = ((result.stage, result.output.mask) for result in later)
                yield step.stage.name, {name: mask for name, mask in masks if mask is not None}
            view = view.after(output)
