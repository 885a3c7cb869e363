"""Overlap numbers of the demo drive: as roadeval prints them, and by libraries of others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from skimage.morphology import erosion, footprint_rectangle, isotropic_dilation
from skimage.segmentation import find_boundaries
from sklearn.metrics import (
    average_precision_score,
    f1_score,
    jaccard_score,
    precision_recall_curve,
    precision_score,
)

import roadeval
from roadeval.config.run import RunConfig
from roadeval.data import BASELINE, FINAL_STAGE, Frame
from roadeval.evaluation.metres import plan_of
from roadeval.geometry.ground import ground_of
from roadeval.runtime.threads import one_thread_each
from roadeval.training.learning import fit

DEMO: Final = Path(__file__).resolve().parents[2] / "recordings" / "demo.mcap"
CAMERA: Final = {"height": 1.42, "pitch": 2.9, "focal": [560]}
CLOSE: Final = 1e-12
"""How far the two values of a number may lie apart."""
PRESET: Final = "robust"
STAGE: Final = "trees"
"""The stage of `robust` that says how probable road is."""
READ: Final = (
    "cityscapesScripts 2.3.0, mmsegmentation 1.2.2, torchmetrics 1.9.0, FiftyOne 1.22.1 and "
    "Ultralytics 8.4.190"
)
"""Sources that were read for `Overlap.reported_by`; KITTI's is its devkit of 2013."""
Array = NDArray[Any]


class Pixels(NamedTuple):
    """The evaluated frames, each ``(H, W)``, and the same pixels in cells of 5 cm from above."""

    truth: list[Array]
    mask: list[Array]
    code: list[Array]
    """Probabilities in 65536 steps."""
    blind: list[Array]
    above: Array
    """``(n,)``: the place in a flat image of each cell that a pixel covers."""

    def from_above(self, images: list[Array]) -> Array:
        """Return the cells of all frames."""
        return np.concatenate([image.ravel()[self.above] for image in images])


class Overlap(NamedTuple):
    """An overlap number: its name, its source, and a library's way to compute it."""

    name: str
    stands: str
    """Place where roadeval shows it."""
    definition: str
    reported_by: str
    library: str
    again: Callable[[Pixels], float]
    key: str
    """Its name in the result of `_printed`."""


def _flat(images: list[Array]) -> Array:
    return np.concatenate([image.ravel() for image in images])


def _all_pixels(score: Callable[..., Any], **options: Any) -> Callable[[Pixels], float]:
    return lambda pixels: float(score(_flat(pixels.truth), _flat(pixels.mask), **options))


def _mean_of_frames(score: Callable[..., Any], **options: Any) -> Callable[[Pixels], float]:
    def again(pixels: Pixels) -> float:
        pairs = zip(pixels.truth, pixels.mask, strict=True)
        return float(np.mean([score(t.ravel(), m.ravel(), **options) for t, m in pairs]))

    return again


def _curve(truth: Array, level: Array) -> tuple[Array, Array]:
    """Return precision and recall of every threshold."""
    precision, recall, _ = precision_recall_curve(truth, level, drop_intermediate=False)
    return precision[:-1], recall[:-1]  # the last is a point that no threshold gives


def _max_f(truth: Array, level: Array) -> float:
    precision, recall = _curve(truth, level)
    return float(np.max(2 * precision * recall / (precision + recall)))


def _eleven_recalls(pixels: Pixels) -> float:
    precision, recall = _curve(pixels.from_above(pixels.truth), _levels(pixels))
    reached = (precision[recall >= tenth / 10] for tenth in range(11))
    return float(np.mean([part.max() if len(part) else 0 for part in reached]))


def _levels(pixels: Pixels) -> Array:
    return pixels.from_above(pixels.code) // 257  # the greatest k for which k / 255 is reached


def _boundary_iou(truth: Array, mask: Array) -> float:
    width = round(0.02 * np.hypot(*truth.shape))

    def band(image: Array) -> Array:
        inner = erosion(np.pad(image, width), footprint_rectangle((2 * width + 1,) * 2))
        return image.ravel() > inner[width:-width, width:-width].ravel()

    return float(jaccard_score(band(truth), band(mask)))


def _boundary_f(truth: Array, mask: Array) -> float:
    edges = [find_boundaries(image, connectivity=2, mode="inner") for image in (truth, mask)]
    near = [isotropic_dilation(edge, 5) for edge in edges]
    recall, precision = (
        float((edge & other).sum() / edge.sum())
        for edge, other in zip(edges, reversed(near), strict=True)
    )
    return 2 * precision * recall / (precision + recall)


def _over_frames(score: Callable[[Array, Array], float]) -> Callable[[Pixels], float]:
    return lambda pixels: float(np.mean([*map(score, pixels.truth, pixels.mask)]))


NUMBERS: Final = (
    Overlap(
        "IoU, of all pixels",
        "`IoU` at the terminal, in reports and `--fail-if`; `pooled_IoU` in `summary.json`",
        "`TP / (TP + FP + FN)` of the counts of all frames together",
        "Cityscapes (IoU of a class), mmsegmentation (`IoU`), torchmetrics `BinaryJaccardIndex`, "
        "Ultralytics (a `-sem` network of one class)",
        "scikit-learn `jaccard_score`",
        _all_pixels(jaccard_score),
        "pooled_IoU",
    ),
    Overlap(
        "IoU, mean of frames",
        "`IoU` in the totals of `summary.json`",
        "the mean of the frames' `TP / (TP + FP + FN)`; a frame without road in mask and truth is "
        "left out",
        "torchmetrics `MeanIoU(per_class=True)`, of road",
        "`jaccard_score`, frame by frame",
        _mean_of_frames(jaccard_score),
        "IoU",
    ),
    Overlap(
        "mIoU, of all pixels",
        "`mIoU` in reports and `--fail-if`; `pooled_mIoU` in `summary.json`",
        "the mean of the IoU of road and that of non-road, of all frames together",
        "mmsegmentation (`mIoU`), torchmetrics `MulticlassJaccardIndex`; Cityscapes' mean is over "
        "19 classes, and Ultralytics' over those that the truth has",
        '`jaccard_score(average="macro")`',
        _all_pixels(jaccard_score, average="macro"),
        "pooled_mIoU",
    ),
    Overlap(
        "mIoU, mean of frames",
        "`mIoU` in the totals of `summary.json`",
        "the mean of the frames' mIoU; a frame that lacks road or non-road in mask and truth is "
        "left out",
        "torchmetrics `MeanIoU`, where every frame has both (else it averages what there is)",
        "the same, frame by frame",
        _mean_of_frames(jaccard_score, average="macro"),
        "mIoU",
    ),
    Overlap(
        "F1 (Dice), of all pixels",
        "`F1` in reports and `--fail-if`; `pooled_F1` in `summary.json`",
        "`2 TP / (2 TP + FP + FN)` of the counts of all frames together",
        "mmsegmentation (`Dice` and `Fscore` of a class), torchmetrics `BinaryF1Score`, FiftyOne "
        "(`fscore` of a class; its `dice` is the ACC of all classes together)",
        "scikit-learn `f1_score`",
        _all_pixels(f1_score),
        "pooled_F1",
    ),
    Overlap(
        "F1 (Dice), mean of frames",
        "`F1` in the totals of `summary.json`",
        "the mean of the frames' F1; a frame without road in mask and truth is left out",
        'torchmetrics `DiceScore(average="none")`, of road: `samplewise` is its default',
        "`f1_score`, frame by frame",
        _mean_of_frames(f1_score),
        "F1",
    ),
    Overlap(
        "precision, of all pixels",
        "`precision` in reports and `--fail-if`; `pooled_precision` in `summary.json`",
        "`TP / (TP + FP)` of the counts of all frames together; recall is `pooled_TPR`",
        "mmsegmentation, torchmetrics `BinaryPrecision`, FiftyOne",
        "scikit-learn `precision_score`",
        _all_pixels(precision_score),
        "pooled_precision",
    ),
    Overlap(
        "precision, mean of frames",
        "`precision` in the totals of `summary.json`",
        "the mean of the frames' `TP / (TP + FP)`; a frame whose mask has no road is left out",
        "-",
        "`precision_score`, frame by frame",
        _mean_of_frames(precision_score),
        "precision",
    ),
    Overlap(
        "boundary IoU",
        "`boundary IoU` in reports; `beyond` in `summary.json`",
        "mean over frames of the IoU of two bands along the edges of mask and truth, 2 % of the "
        "diagonal wide",
        "the authors of Boundary IoU (CVPR 2021); none of the others",
        "scikit-image `erosion`, `jaccard_score`",
        _over_frames(_boundary_iou),
        "boundary_IoU",
    ),
    Overlap(
        "boundary F",
        "`boundary F` in reports; `beyond` in `summary.json`",
        "mean over frames of the F1 of edge pixels that lie within 5 pixels of the other edge",
        "DAVIS (its F, within 0.8 % of the diagonal); none of the others",
        "scikit-image `find_boundaries`, `isotropic_dilation`",
        _over_frames(_boundary_f),
        "boundary_F",
    ),
    Overlap(
        "MaxF, in the image",
        "`MaxF` in reports; `curves` in `summary.json`",
        "the greatest F1 of all thresholds on the probability, of all pixels together",
        "none of them: KITTI's is of the ground seen from above",
        "scikit-learn `precision_recall_curve`",
        lambda pixels: _max_f(_flat(pixels.truth), _flat(pixels.code)),
        "curve_MaxF",
    ),
    Overlap(
        "AP, in the image",
        "`AP` in reports; `curves` in `summary.json`",
        "`sum (R_k - R_(k-1)) P_k` over all thresholds, without interpolation",
        "scikit-learn, torchmetrics `BinaryAveragePrecision`; the AP of COCO, FiftyOne and "
        "Ultralytics is of objects, and no number here",
        "`average_precision_score`",
        lambda pixels: float(average_precision_score(_flat(pixels.truth), _flat(pixels.code))),
        "curve_AP",
    ),
    Overlap(
        "MaxF, from above",
        "`MaxF` of `from_above` in reports and `metres.csv`",
        "the greatest F1 of 256 thresholds, of all cells of 5 cm of ground of all frames",
        "KITTI's road benchmark (`MaxF`)",
        "`precision_recall_curve` of cells",
        lambda pixels: _max_f(pixels.from_above(pixels.truth), _levels(pixels)),
        "MaxF",
    ),
    Overlap(
        "AP11, from above",
        "`AP11` of `from_above` in reports and `metres.csv`",
        "the mean over the recalls 0, 0.1 ... 1 of the greatest precision at that recall or more",
        "KITTI's road benchmark (`AvgPrec`), Pascal VOC until 2009",
        "`precision_recall_curve` of cells",
        _eleven_recalls,
        "AP11",
    ),
    Overlap(
        "F1, from above",
        "`F1` of `from_above` in `metres.csv`; of `blind` here",
        "F1 of all cells of a mask without probabilities",
        "KITTI's road benchmark, of a mask alone (`MaxF`)",
        "`f1_score` of cells",
        lambda pixels: float(f1_score(*map(pixels.from_above, (pixels.truth, pixels.blind)))),
        "blind_F1",
    ),
)


class DifferentNumberError(Exception):
    """A library computes another value than roadeval."""


def measure() -> dict[str, Any]:
    """Return each number of the whole drive by its name, as `compared` does."""
    return compare_libraries(*replay_demo())


def replay_demo(**more: Mapping[str, Any]) -> tuple[int, dict[str, float], Pixels]:
    """Return how many frames were evaluated, roadeval's numbers of them, and their pixels.

    All frames of the demo drive are read unless ``more`` tables of the configuration say otherwise.
    """
    tables = {"preset": PRESET, "ground": CAMERA, "output": {"record": "masks", "figures": False}}
    config = roadeval.configure({**tables, **more})
    with TemporaryDirectory() as folder:
        path = Path(folder)
        outcome = roadeval.replay(DEMO, config, save=path / "it.rrd", reports=path / "it")
        metres = pd.read_csv(path / "it" / "metres.csv")
        ours = dict(_printed(outcome.summary, metres))
        with one_thread_each():  # as a replay does: OpenCV rounds by the number of threads
            pixels = _pixels(roadeval.Recording(path / "it.rrd"), config)
    return outcome.summary["frames"]["evaluated"], ours, pixels


def compare_libraries(evaluated: int, ours: Mapping[str, float], pixels: Pixels) -> dict[str, Any]:
    """Return each number by its name: ``roadeval``'s value, and the ``library``'s.

    A `DifferentNumberError` if the two are not equal.
    """
    values = {}
    for number in NUMBERS:
        printed, other = ours[number.key], number.again(pixels)
        if not abs(printed - other) <= CLOSE:
            raise DifferentNumberError(
                f"{number.name}: {printed} by roadeval, {other} by a library"
            )
        values[number.name] = {"roadeval": printed, "library": other}
    return {"evaluated": evaluated, "values": values}


def _printed(summary: dict[str, Any], metres: pd.DataFrame) -> Iterator[tuple[str, float]]:
    """Yield roadeval's numbers of the final mask by `Overlap.key`."""
    yield from summary["totals"][PRESET][FINAL_STAGE].items()
    yield from summary["beyond"][PRESET].items()
    curve = summary["curves"][PRESET][STAGE]
    yield from ((f"curve_{name}", value) for name, value in curve.items())
    above = metres[metres["where"] == "from_above"]
    for variant, prefix in ((PRESET, ""), (BASELINE, f"{BASELINE}_")):
        rows = above[above["variant"] == variant]
        taken = rows["measure"].isin(["MaxF", "AP11", "F1"])
        values = rows[taken].set_index("measure")["value"]
        yield from ((f"{prefix}{name}", float(value)) for name, value in values.items())


def _pixels(recording: roadeval.Recording, config: RunConfig) -> Pixels:
    """Return the pixels of the evaluated frames; probabilities come from the same training."""
    evaluated = sorted({*recording.frames["frame"].tolist()})
    trained = [number for number in recording.frame_numbers if number < evaluated[0]]
    drive = [
        Frame(number, 0, 0, recording.image(number), b"", truth=recording.truth(number))
        for number in trained
    ]
    model = fit(drive, config.pipelines(), config.training)
    truth = [recording.truth(number) for number in evaluated]
    height, width = truth[0].shape
    ground, _ = ground_of(None, config.ground, (width, height))
    assert ground is not None
    assert model.prior is not None
    cells = plan_of(ground, config.evaluation).cells.ravel()
    pixels = Pixels(truth, [], [], [], cells[cells >= 0])
    for number in evaluated:
        result = roadeval.run_frame(recording.image(number), model, config, variant=PRESET)
        (code,) = (step.output.probability for step in result.stages if step.stage == STAGE)
        assert code is not None
        pixels.mask.append(recording.layer(PRESET, FINAL_STAGE, number))
        pixels.code.append(code)
        pixels.blind.append((model.prior >= 0.5).astype(np.uint8))
    return pixels
