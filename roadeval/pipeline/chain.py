"""A pipeline, its stages and their settings; and a chain, the pipeline ready to run."""

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

    ``chain`` has the names that `roadeval.pipeline.stages.stages_of` takes, which may differ from
    the stages' own names; ``settings`` are by the stages' own names.
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
        """Return the layers of the stages' outputs, in order."""
        return tuple(spec for stage, settings in self._pairs() for spec in stage.specs(settings))

    def masks(self) -> tuple[str, ...]:
        """Return the names of the stages that make a road mask, in order."""
        return tuple(stage.name for stage in self.stages() if stage.yields_mask)

    def without_filter(self) -> Pipeline:
        """Return the pipeline without its filters."""
        pairs = zip(self.chain, self.stages(), strict=True)
        names = {name: stage.name for name, stage in pairs if not stage.is_filter}
        return Pipeline(tuple(names), {name: self.settings[name] for name in names.values()})

    def learning_stages(self) -> tuple[str, ...]:
        """Return the names of the stages that learn."""
        return tuple(stage.name for stage in self.stages() if stage.fit is not None)

    def relevant_settings(self) -> dict[str, dict[str, Any]]:
        """Return the settings that the learnt parameters depend on, by stage.

        These are settings of stages that learn, change the image, or are heard, except those that
        are `inference_only` or `places`.
        """
        heard = self.heard_stages()
        return {
            stage.name: {
                key: value
                for key, value in asdict(settings).items()
                if key not in (*stage.inference_only, *stage.places)
            }
            for stage, settings in self._pairs()
            if stage.fit is not None or not stage.yields_mask or stage in heard
        }

    def heard_stages(self) -> tuple[Stage, ...]:
        """Return the stages whose masks a later stage learns from."""
        pairs = self._pairs()
        hearing = [place for place, (s, values) in enumerate(pairs) if s.hears and s.hears(values)]
        return tuple(stage for stage, _ in pairs[: max(hearing, default=0)] if stage.yields_mask)

    def resolved(self) -> Pipeline:
        """Return the pipeline with the settings that its stages read from files.

        A `RoadevalError` if a file cannot be used.
        """
        read = {s.name: s.resolve(settings) for s, settings in self._pairs() if s.resolve}
        return replace(self, settings={**self.settings, **read})

    def without_places(self) -> Pipeline:
        """Return the pipeline without the settings that are paths of files."""
        blank = {
            stage.name: replace(settings, **dict.fromkeys(stage.places, ""))
            for stage, settings in self._pairs()
        }
        return replace(self, settings=blank)

    def about(self) -> dict[str, dict[str, Any]]:
        """Return the stages' facts for results beside their settings, by stage."""
        return {s.name: dict(s.about(settings)) for s, settings in self._pairs() if s.about}

    def as_dict(self) -> dict[str, Any]:
        """Return the chain and its settings as plain data, in the shape of a TOML file."""
        settings = {name: asdict(values) for name, values in self.settings.items()}
        return {"chain": list(self.chain), **settings}

    def bind(self, parameters: Mapping[str, Any]) -> Chain:
        """Return the chain that runs with the parameters that each stage has learnt, by stage.

        A `MisfitError` if they do not fit the settings.
        """
        steps = []
        for stage, settings in self._pairs():
            learnt = parameters.get(stage.name)
            steps.append(Step(stage, settings, learnt, stage.bind(settings, learnt)))
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
        """Yield the output and the seconds of each stage; ``view`` is the input of the first one.

        A stage runs when its result is taken. ``shared`` holds the results that the chains of a
        frame share: a first stage that makes a mask and learns nothing runs only once, such as a
        network that is one variant and is tuned in another.
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
        """Yield the masks of the chain with one of its stages replaced by the truth.

        ``view`` and ``outputs`` are the argument and the outputs of `run`, ``road`` and ``shadow``
        the truths, ``(H, W)`` uint8 (0, 1, 255). Without the truth of shadow no filter is replaced.
        Yielded are the name of the replaced stage, and the masks of the stages after it.
        """
        for place, (step, output) in enumerate(zip(self.steps, outputs, strict=True), 1):
            truth = shadow if step.stage.is_filter else road
            if (oracle := step.stage.oracle) is not None and truth is not None:
                seen = view.after(oracle(step.settings, step.parameters, view, truth))
                later = Chain(self.steps[place:]).run(seen)
                masks = ((result.stage, result.output.mask) for result in later)
                yield step.stage.name, {name: mask for name, mask in masks if mask is not None}
            view = view.after(output)
