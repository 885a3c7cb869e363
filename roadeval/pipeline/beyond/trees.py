"""Boosted trees on the features of a pixel: how probable road is.

The log-odds of road are the weighted mean of two estimates: the sum of many small decision trees,
each grown to correct the errors of the trees before it [1]_, and a network with one hidden layer
(`hidden_layer`). A term that is not learnt is subtracted:
``x = mean - w s max(d - 1, 0)`` with the distance d from the reference patch, 1 where roads end,
and the share s of light (`roadeval.pipeline.beyond.features`); ``p = 1 / (1 + exp(-x))``. It is
computed on a working image, and interpolated linearly to the camera's pixels.

References
----------
.. [1] J. H. Friedman, Greedy Function Approximation: A Gradient Boosting Machine, The Annals of
   Statistics 29 (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from roadeval.data import CERTAIN, Layer, LayerKind, LayerSpec, Packed, Rgb, mask_spec
from roadeval.data.arrays import Flags, Floats, Indices, Masks, Values, sigmoid
from roadeval.kernels import KERNELS
from roadeval.kernels.plain import LEAVES
from roadeval.pipeline import stage
from roadeval.pipeline.beyond.features import (
    GROUPS,
    LIGHT,
    SUNLIT,
    beyond,
    features,
    light_over,
    light_share,
    names_of,
    opinion_features,
    sample_features,
)
from roadeval.pipeline.beyond.hidden_layer import HiddenLayer, train
from roadeval.pipeline.reference_patch import ReferencePatch, Share
from roadeval.pipeline.scene import Scene, reach, scene_of, stretch
from roadeval.pipeline.stage import Output, Stage, StageError, TrainingSet, View

Sizes = npt.NDArray[np.int32]

NODES: Final = LEAVES
"""Places for the nodes of a tree, which uses at most ``LEAVES - 1``. No feature exceeds the
threshold of the unused ones."""
ALL: Final = (1 << LEAVES) - 1
"""The bits of all leaves."""
BINS: Final = 255
"""Ranges of a feature that a tree can tell apart, the most that scikit-learn allows."""
RATE: Final = 0.1
"""Share of the remaining error that a tree corrects."""
MOST_LEAVES: Final = 31
"""Greatest number of leaves of a tree."""
LEAST: Final = 50
"""Least number of training pixels in a leaf, mirrored ones included."""
SHARE: Final = 0.33
"""Share of the features among which a node chooses; each node draws its own."""


@dataclass(frozen=True, eq=False)
class Forest:
    """The sum of T trees, see `roadeval.kernels.plain.tree_sum`."""

    feature: Indices
    """``(T, NODES)`` int32: the feature that a node looks at."""
    threshold: Values
    """``(T, NODES)`` float32: the number that the node compares it with."""
    kept: Masks
    """``(T, NODES)`` uint32: a bit for each leaf that remains if the feature is above it."""
    values: Values
    """``(T, LEAVES)`` float32: the number that each leaf adds."""
    offset: float
    """Start of the sum."""
    inputs: int
    """Number of features that there were to choose from."""

    def __post_init__(self) -> None:
        trees = len(self.feature)
        stage.check_arrays(self, np.int32, feature=("T", NODES))
        stage.check_arrays(self, np.uint32, kept=(trees, NODES))
        stage.check_arrays(self, np.float32, threshold=(trees, NODES))
        stage.check_arrays(self, np.float32, values=(trees, LEAVES), offset=(), inputs=())
        stage.check_range("feature", self.feature, 0, self.inputs - 1)
        if not (self.kept >> np.uint32(LEAVES - 1)).all():
            raise ValueError("kept rules out a tree's last leaf, and so may leave none")

    def sums(self, values: Values) -> Values:
        """Return the sum for each pixel of ``(inputs, n)`` features, ``(n,)`` float32."""
        arrays = self.feature, self.threshold, self.kept, self.values
        return KERNELS.tree_sum(values, *arrays) + self.offset


def grow(values: Values, road: Flags, weights: Floats | None, trees: int, seed: int) -> Forest:
    """Grow trees with scikit-learn's gradient boosting on histograms.

    One thread grows them: the last digits of sums by many threads differ from run to run.
    ``values`` are ``(n, F)`` finite features; ``road`` are ``(n,)`` labels, and both occur;
    ``weights`` are ``(n,)`` and above 0, None if all pixels weigh the same. ``trees`` is their
    number, ``seed`` that of the features among which a node chooses.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    # scikit-learn's own weighted quantiles take several times as long as all trees.
    parts = np.arange(1, BINS) / BINS
    quantiles = np.quantile(values, parts, axis=0, weights=weights, method="inverted_cdf")
    edges = [np.unique(feature) for feature in quantiles.T]
    bins = [
        np.searchsorted(bounds, feature).astype(np.uint8)
        for bounds, feature in zip(edges, values.T, strict=True)
    ]

    boosting = HistGradientBoostingClassifier(
        learning_rate=RATE,
        max_iter=trees,
        max_leaf_nodes=MOST_LEAVES,
        min_samples_leaf=LEAST,
        max_features=SHARE,
        early_stopping=False,
        random_state=seed,
    )
    with threadpool_limits(1, "openmp"):
        boosting.fit(np.stack(bins, axis=1), road, sample_weight=weights)
    offset, grown = nodes_of(boosting)
    rows = [tree_rows(nodes, edges) for nodes in grown]
    feature, threshold, kept, leaves = map(np.stack, zip(*rows, strict=True))
    return Forest(feature, threshold, kept, leaves, offset, values.shape[1])


def nodes_of(boosting: Any) -> tuple[float, list[npt.NDArray[Any]]]:
    """Return the start of the sum and the nodes of each tree of scikit-learn's classifier.

    They are private there, and read here alone. A model file must hold plain arrays, and
    scikit-learn's public way is a pickle, which can run code. Its ``decision_function`` also takes
    0.55 s of CPU for a frame, `Forest.sums` 0.008 s.
    """
    return boosting._baseline_prediction.item(), [tree.nodes for (tree,) in boosting._predictors]


def tree_rows(
    nodes: npt.NDArray[Any], edges: Sequence[Values]
) -> tuple[Indices, Values, Masks, Values]:
    """Return a tree on bins as a row of each of a forest's arrays; its root comes first."""
    feature, threshold = np.zeros(NODES, np.int32), np.full(NODES, stage.GREATEST, np.float32)
    kept, values = np.full(NODES, ALL, np.uint32), np.zeros(LEAVES, np.float32)
    leaves = {int(place): leaf for leaf, place in enumerate(_leaves(nodes, 0))}
    values[: len(leaves)] = nodes["value"][list(leaves)]
    inner = np.flatnonzero(nodes["is_leaf"] == 0)
    feature[: len(inner)] = nodes["feature_idx"][inner]
    # A node's threshold, rounded down, is the last bin that goes left: its edge is the feature's.
    threshold[: len(inner)] = [
        edges[node["feature_idx"]][int(node["num_threshold"])] for node in nodes[inner]
    ]
    for place, node in enumerate(inner):
        ruled_out = sum(1 << leaves[leaf] for leaf in _leaves(nodes, int(nodes["left"][node])))
        kept[place] = ALL & ~ruled_out
    return feature, threshold, kept, values


def _leaves(nodes: npt.NDArray[Any], root: int) -> Iterator[int]:
    """Yield the places of a subtree's leaves, from the left."""
    if nodes["is_leaf"][root]:
        yield root
        return
    for side in ("left", "right"):
        yield from _leaves(nodes, int(nodes[side][root]))


IN_LIGHT, IN_SHADE = 2 / 3, 1 / 3
"""Weight of the network in the mean."""
OWN_CAMERA, OTHERS = 1.0, 4.0
"""``reach_weight`` for a camera whose images taught the trees, and for any other."""
FARTHEST: Final = 3.0
"""Greatest distance from the patch that is shown."""

TREES: Final = mask_spec("trees", "Road by boosted trees")
PROBABILITY: Final = LayerSpec(
    "probability", LayerKind.SCALAR, "How probable road is, by boosted trees", exact=False
)
GEODESIC: Final = LayerSpec(
    "geodesic",
    LayerKind.SCALAR,
    "Distance from the reference patch over edges; roads end at about 1",
    value_range=(0.0, FARTHEST),
    exact=False,
    photographic=True,
)


@stage.stage_settings
class TreesSettings:
    """Settings of the boosted trees.

    width: Columns of the working image.
    features: Groups of features, see `roadeval.pipeline.beyond.features`.
    opinion: Whether the output of the stage before is a feature, too: its log-odds of road, or the
        distance to its mask's edge.
    trees: Number of trees. The time of a decision grows with it.
    reach_weight: ``reach_weight`` times ``s max(d - 1, 0)`` is subtracted from the log-odds. The
        distance d from the patch is 1 where roads end, after the stage ``exposure``; s is 1 in the
        light and 0 in the shade. Default: 1 if images of the frame's size taught the trees, which
        are taken for the camera's own; 4 if other cameras taught them: there it may correct much.
    threshold: A pixel is road if its probability of road is above this.
    """

    width: Annotated[int, Field(ge=32, le=1024)] = 160
    features: Annotated[tuple[str, ...], Field(min_length=1)] = tuple(GROUPS)
    opinion: bool = False
    trees: Annotated[int, Field(ge=1, le=10_000)] = 150
    reach_weight: Annotated[float, Field(ge=0, le=100)] | None = None
    threshold: Share = 0.5

    @field_validator("features")
    @classmethod
    def _check_features(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len({*names} & GROUPS.keys()) < len(names):
            raise ValueError(f"must be groups among {', '.join(GROUPS)}, each once")
        return names


@dataclass(frozen=True, eq=False)
class Blend:
    """A forest and a network that learnt from the same pixels, maybe on top of another blend."""

    forest: Forest
    network: HiddenLayer
    sizes: Sizes
    """``(n, 2)`` int32: the different heights and widths of the images that taught them."""
    base: Blend | None = None
    """The blend of other drives; its log-odds are the last feature."""

    def __post_init__(self) -> None:
        stage.check_arrays(self, np.int32, sizes=("n", 2))
        stage.check_range("sizes", self.sizes, 1, stage.GREATEST)
        inputs = self.network.inputs
        if self.forest.inputs != inputs or (self.base and self.base.inputs != inputs - 1):
            raise ValueError("forest, network and base take different numbers of features")

    @property
    def inputs(self) -> int:
        """Number of features of a pixel that it takes."""
        return self.base.inputs if self.base else self.network.inputs

    def knows(self, image: Rgb) -> bool:
        """Return whether images of this size taught it or its base."""
        is_known = (self.sizes == image.shape[:2]).all(axis=1).any()
        return bool(is_known or (self.base and self.base.knows(image)))

    def log_odds(self, values: Values, weight: Values | float) -> Values:
        """Return the log-odds of road for each pixel of ``(inputs, n)`` features, ``(n,)``.

        ``weight`` is the network's in the mean, 0 to 1: one number, or ``(n,)``, also for the base.
        """
        if self.base is not None:
            values = np.concatenate([values, self.base.log_odds(values, weight)[None]])
        trees = self.forest.sums(values)
        return trees + weight * (self.network.sums(values) - trees)


def see(settings: TreesSettings, image: Rgb, opinion: Output | None = None) -> tuple[Scene, Values]:
    """Return the scene of ``(H, W, 3)`` uint8 RGB, and its features, ``(F, h, w)`` float32.

    The features of the opinion come last, if the settings ask for it.
    """
    scene = scene_of(image, settings.width, ReferencePatch())
    planes = features(scene, settings.features)
    if not settings.opinion:
        return scene, planes
    if opinion is None:
        problem = "asks for a stage before it that makes a road mask"
        raise StageError(problem, setting="trees.opinion")
    return scene, np.concatenate([planes, opinion_features(opinion, scene.shape)])


def fit(sample: TrainingSet, settings: TreesSettings, base: Blend | None = None) -> Blend:
    """Grow the trees, and train the network, on the sampled pixels and their mirror images.

    The sample has as many pixels of road as of the rest. If the frames' share of road is known, the
    classes get the weights that they have in the frames. The output of ``base`` is one more
    feature.
    """
    values = np.concatenate(sample_features(sample, partial(see, settings)))
    if base is not None:
        by_feature = np.ascontiguousarray(values.T)
        odds = base.log_odds(by_feature, network_weight(by_feature, settings))
        values = np.column_stack([values, odds])
    road = np.concatenate([sample.road, sample.road])
    weights = None if sample.share is None else class_weights(road, sample.share)
    forest = grow(values, road, weights, settings.trees, sample.seed)
    network = train(values, road, weights, sample.seed)
    sizes = np.unique(np.array([image.shape[:2] for image in sample.images], np.int32), axis=0)
    return Blend(forest, network, sizes, base)


def adapt(base: Blend, sample: TrainingSet, settings: TreesSettings) -> Blend:
    """Learn from a drive's own pixels, on top of the model of other drives."""
    if base.base is not None:
        raise stage.MisfitError("the model was adapted to a drive already; train it again")
    check_fit(base, settings)
    return fit(sample, settings, base)


def class_weights(road: Flags, share: float) -> Floats:
    """Return weights ``(n,)`` with mean 1 that make the weighted share of road ``share``."""
    sampled = road.mean()
    return np.where(road, share / sampled, (1 - share) / (1 - sampled))


def check_fit(learnt: Blend, settings: TreesSettings) -> None:
    """Raise a `MisfitError` if the trees were grown on more or fewer features of a pixel."""
    computed = len(names_of(settings.features))
    if settings.opinion == (learnt.inputs == computed) or learnt.inputs < computed:
        raise stage.MisfitError(
            f"the model's trees were grown on {learnt.inputs} features of a pixel, and this "
            f"version computes {computed}; train it again"
        )


def network_weight(values: Values, settings: TreesSettings) -> Values | float:
    """Return the network's weight in the mean for ``(F, n)`` features, ``(n,)`` float32.

    Trees that fit their few frames to the last pixel are over-confident by a factor of two or more,
    and would outvote the network. So the network's weight is two thirds in the light, and one third
    in the shade, where it misses more road.
    """
    names = names_of(settings.features)
    if LIGHT not in names:
        return IN_LIGHT
    return IN_SHADE + (IN_LIGHT - IN_SHADE) * light_share(values[names.index(LIGHT)])


def bind(settings: TreesSettings, learnt: Blend) -> Callable[[View], Output]:
    """Return the trees as a pure function of a view; a `MisfitError`, see `check_fit`."""
    check_fit(learnt, settings)
    _, share_spec, _ = layers(settings)

    def run(view: View) -> Output:
        """Return the road of a view, its probability, and the distances from the patch."""
        shape = view.image.shape
        scene, planes = see(settings, view.image, view.opinion)
        if len(planes) != learnt.inputs:
            raise StageError(
                f"trees: a pixel has {len(planes)} features, but the model was trained on "
                f"{learnt.inputs}: the stage before it gives other classes of road than then"
            )
        far, (light,) = reach(scene), light_over(scene, SUNLIT).values()
        weight = settings.reach_weight
        if weight is None:
            weight = OWN_CAMERA if learnt.knows(view.original) else OTHERS
        values = planes.reshape(len(planes), -1)
        odds = learnt.log_odds(values, network_weight(values, settings)).reshape(scene.shape)
        share = stretch(sigmoid(odds - weight * beyond(far, light)), shape)
        codes = np.rint(share * CERTAIN).astype(np.uint16)
        road = Packed.of(codes > round(settings.threshold * CERTAIN))
        shown = (
            Layer(GEODESIC, stretch(far, shape)),
            Layer(share_spec, (codes >> 8).astype(np.uint8)),
            Layer(TREES, road),
        )
        return Output(shown, mask=road, probability=codes)

    return run


def layers(settings: TreesSettings) -> tuple[LayerSpec, ...]:
    """Return the layers; with ``opinion`` the stage before it may have a ``probability``, too."""
    share = replace(PROBABILITY, name="tuned_probability") if settings.opinion else PROBABILITY
    return GEODESIC, share, TREES


STAGE: Final = Stage(
    name="trees",
    title="Boosted trees on colour, place, texture, surroundings and paths from the patch",
    settings=TreesSettings,
    bind=bind,
    layers=layers,
    fit=fit,
    adapt=adapt,
    parameters=Blend,
    oracle=stage.perfect_mask,
    inference_only=("reach_weight", "threshold"),
    hears=lambda settings: settings.opinion,
)
