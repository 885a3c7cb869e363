"""The plain way: the pipeline as the tests hold ours to, each stage timed, its masks compared.

NumPy expressions, scikit-image, scikit-learn's ``predict``, and ``rr.log`` of the arrays as they
are. `tests.pipeline.reference` is that pipeline; here it is only cut into stages.
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import rerun as rr

from roadeval.config.run import RunConfig
from roadeval.data import FILTERED, UNFILTERED, Frame, VariantResult
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import TrainingSet, View
from roadeval.training.learning import sample
from tests.pipeline import reference

Times = dict[str, list[float]]


class PlainWay:
    """Both variants, trained on the frames and pixels that `roadeval.replay` trains on."""

    def __init__(self, frames: list[Frame], config: RunConfig) -> None:
        settings = config.training
        first = frames[: settings.frames]
        pixels = sample([frame.truth for frame in first], settings)
        where = pixels.frame, pixels.row, pixels.column, pixels.road
        self.models = {}
        for variant in config.variants():
            pipeline = variant.pipeline
            images = tuple(frame.image for frame in first)
            if "shadow" in pipeline.chain:
                (step,) = Pipeline(("shadow",), pipeline.settings).bind({}).steps
                images = tuple(step.run(View.of(image)).image for image in images)
            colours = TrainingSet(images, *where).colours()
            self.models[variant.name] = reference.train(colours, pixels.road)
        self.times: Times = {}
        self._stream = rr.RecordingStream("plain", recording_id="plain")

    def save(self, path: Path) -> None:
        """Log to a file."""
        self._stream.save(path)

    def require_same_machine(self, variant: str, machine: Any) -> None:
        """Refuse to compare two models that are not the same."""
        theirs = self.models[variant].machine[-1]
        np.testing.assert_array_equal(theirs.support_vectors_, machine.vectors)
        np.testing.assert_array_equal(theirs.dual_coef_[0], machine.weights)

    def run(self, frame: Frame, ours: tuple[VariantResult, ...]) -> None:
        """Run, time and log both variants of a frame; raise if a mask differs from ours."""
        self._stream.set_time("frame", sequence=frame.number)
        self._log({"camera": frame.image}, "camera")
        for result in ours:
            layers = self._layers(frame.image, result.variant)
            self._log(layers, result.variant)
            for stage, mask in result.masks():
                np.testing.assert_array_equal(
                    layers[stage], mask.pixels(), f"{result.variant} {stage}"
                )

    def _layers(self, image: np.ndarray, variant: str) -> dict[str, np.ndarray]:
        model, layers, clock = self.models[variant], {}, perf_counter()
        if variant != UNFILTERED:
            codes = reference.ndi_codes(image)
            shadow = reference.shadow_mask(codes)
            changed = np.clip(np.rint(reference.compensate(image, shadow)), 0, 255)
            image = changed.astype(np.uint8)
            rings = shadow + 2 * reference.rings(shadow)
            layers |= {"ndi": codes, "shadow": shadow, "rings": rings, "compensated": image}
            clock = self._lap(f"{FILTERED} shadow", clock)
        layers["distance"] = reference.distance(image, model)
        layers["similarity"] = layers["distance"] ** 2 <= reference.CHI2_95
        clock = self._lap(f"{variant} similarity", clock)
        # Not `decision`: a user asks for the classes.
        classes = model.machine.predict(image.reshape(-1, 3)).reshape(image.shape[:2])
        layers["svm"] = classes.astype(bool)
        clock = self._lap(f"{variant} svm", clock)
        layers["post"] = reference.post(layers["svm"])
        layers["boundary"] = reference.boundary(layers["post"])
        self._lap(f"{variant} post", clock)
        return layers

    def _log(self, layers: dict[str, np.ndarray], where: str) -> None:
        start = perf_counter()
        for name, array in layers.items():
            self._stream.log(f"{where}/{name}", _picture(name, array))
        self._stream.flush()
        self._lap("all record", start)

    def _lap(self, name: str, since: float) -> float:
        now = perf_counter()
        self.times.setdefault(name, []).append(now - since)
        return now


def _picture(name: str, array: np.ndarray) -> Any:
    if array.ndim == 3:
        return rr.Image(array)
    if name == "distance":
        return rr.DepthImage(array.astype(np.float32))
    return rr.SegmentationImage(array.astype(np.uint8))
