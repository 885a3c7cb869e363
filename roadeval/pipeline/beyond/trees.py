"""Boosted trees on what is known of a pixel of the ground: how probable road is.

The log-odds of road are the weighted mean of two opinions: the sum of many small decision trees,
each of which was grown to mend what those before it leave [1]_, and a network with one hidden layer
(`hidden_layer`). A term that is not learnt is taken from them:
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
from roadeval.pipeline.beyond.features import (
    GROUPS,
    LIGHT,
    SUNLIT,
    at_samples,
    beyond,
    features,
    light_over,
    lit,
    names_of,
    opinions,
)
from roadeval.pipeline.beyond.hidden_layer import HiddenLayer, train
from roadeval.pipeline.reference_patch import ReferencePatch, Share
from roadeval.pipeline.scene import Scene, reach, scene_of, stretched
from roadeval.pipeline.stage import (
    GREATEST,
    MisfitError,
    Output,
    Stage,
    StageError,
    TrainingSet,
    View,
    check_arrays,
    check_range,
    perfect_mask,
    stage_settings,
)

Sizes = npt.NDArray[np.int32]

NODES: Final = LEAVES
"""Places for the nodes of a tree, which uses ``LEAVES - 1`` at most. Nothing exceeds the threshold
of the others."""
ALL: Final = (1 << LEAVES) - 1
"""The bits of all leaves."""
BINS: Final = 255
"""Ranges of a feature that a tree can tell apart: the most that scikit-learn knows."""
RATE: Final = 0.1
"""Share of what is left to mend that a tree mends."""
MOST_LEAVES: Final = 31
"""Of a tree."""
LEAST: Final = 50
"""Training pixels of a leaf, mirrored ones included."""
SHARE: Final = 0.33
"""Of the features, drawn anew for each node, among which it chooses."""


@dataclass(frozen=True, eq=False)
class Forest:
    """The sum of T trees, see `roadeval.kernels.plain.tree_sum`."""

    feature: Indices
    """``(T, NODES)`` int32: which feature a node looks at."""
    threshold: Values
    """``(T, NODES)`` float32: what the node compares it with."""
    kept: Masks
    """``(T, NODES)`` uint32: a bit for each leaf that is left where the feature is above that."""
    values: Values
    """``(T, LEAVES)`` float32: what each leaf adds."""
    offset: float
    """Where the sum begins."""
    inputs: int
    """How many features of a pixel there were to choose from."""

    def __post_init__(self) -> None:
        check_arrays(self, np.int32, feature=("T", NODES))
        check_arrays(self, np.uint32, kept=(len(self.feature), NODES))
        check_arrays(self, np.float32, threshold=(len(self.feature), NODES))
        check_arrays(self, np.float32, values=(len(self.feature), LEAVES), offset=(), inputs=())
        check_range("feature", self.feature, 0, self.inputs - 1)
        if not (self.kept >> np.uint32(LEAVES - 1)).all():
            raise ValueError("kept rules out a tree's last leaf, and so may leave none")

    def sums(self, values: Values) -> Values:
        """Return the sum for each pixel of ``(inputs, n)`` features, ``(n,)`` float32."""
        arrays = self.feature, self.threshold, self.kept, self.values
        return KERNELS.tree_sum(values, *arrays) + self.offset


def grow(values: Values, road: Flags, weights: Floats | None, trees: int, seed: int) -> Forest:
    """Grow trees with scikit-learn's gradient boosting on histograms.

    By one thread: sums of many threads end with other last digits from one run to the next.
    ``values`` are ``(n, F)`` finite features, ``road`` ``(n,)`` labels, of which both occur;
    ``weights`` are ``(n,)`` above 0, None where all pixels weigh the same. ``trees`` is their
    number, ``seed`` draws the features among which a node chooses.
    """
    from threadpoolctl import threadpool_limits

    # scikit-learn's own weighted quantiles take several times as long as all trees.
    parts = np.arange(1, BINS) / BINS
    quantiles = np.quantile(values, parts, axis=0, weights=weights, method="inverted_cdf")
    edges = [np.unique(feature) for feature in quantiles.T]
    bins = [np.searchsorted(*each).astype(np.uint8) for each in zip(edges, values.T, strict=True)]
    # Only here: the import takes a second, and a model from a file does not need it.
    from sklearn.ensemble import HistGradientBoostingClassifier

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
    grown = [_arrays(tree.nodes, edges) for (tree,) in boosting._predictors]
    feature, threshold, kept, leaves = map(np.stack, zip(*grown, strict=True))
    offset = boosting._baseline_prediction.item()
    return Forest(feature, threshold, kept, leaves, offset, values.shape[1])


def _arrays(
    nodes: npt.NDArray[Any], edges: Sequence[Values]
) -> tuple[Indices, Values, Masks, Values]:
    """Return a tree on bins as a row of each of a forest's arrays; its root comes first."""
    feature, threshold = np.zeros(NODES, np.int32), np.full(NODES, GREATEST, np.float32)
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
"""The network's weight."""
OWN_CAMERA, OTHERS = 1.0, 4.0
"""``reach_weight`` where the camera itself taught the trees, and where others did."""
FARTHEST: Final = 3.0
"""Of the distances from the patch as they are shown."""

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
)


@stage_settings
class TreesSettings:
    """Settings of the boosted trees."""

    width: Annotated[int, Field(ge=32, le=1024)] = 160
    """Columns of the working image."""
    features: Annotated[tuple[str, ...], Field(min_length=1)] = tuple(GROUPS)
    """Groups of features, see `roadeval.pipeline.beyond.features`."""
    opinion: bool = False
    """Whether what the stage before says of a pixel is a feature, too: its log-odds of road, or the
    distance to its mask's edge."""
    trees: Annotated[int, Field(ge=1, le=10_000)] = 150
    """Number of trees. The time of a decision grows with it."""
    reach_weight: Annotated[float, Field(ge=0, le=100)] | None = None
    """``reach_weight`` times ``s max(d - 1, 0)`` is taken from the log-odds. The distance d from
    the patch is 1 where roads end, after the stage ``exposure``; s is 1 in the light and 0 in
    the shade. By default it is 1 where images of the frame's size taught the trees, which are
    taken for the camera's own, and 4 where other cameras did: there it may mend much."""
    threshold: Share = 0.5
    """A pixel is road where it is more probable than this."""

    @field_validator("features")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len({*names} & GROUPS.keys()) < len(names):
            raise ValueError(f"must be groups among {', '.join(GROUPS)}, each once")
        return names


@dataclass(frozen=True, eq=False)
class Blend:
    """A forest and a network that learnt from the same pixels, maybe on top of another blend."""

    forest: Forest
    network: HiddenLayer
    sizes: Sizes
    """``(n, 2)`` int32: height and width of the images that taught them, each once."""
    base: Blend | None = None
    """The one of other drives, whose log-odds are the last feature of these."""

    def __post_init__(self) -> None:
        check_arrays(self, np.int32, sizes=("n", 2))
        check_range("sizes", self.sizes, 1, GREATEST)
        own = self.network.inputs
        if self.forest.inputs != own or (self.base and self.base.inputs != own - 1):
            raise ValueError("forest, network and base take different numbers of features")

    @property
    def inputs(self) -> int:
        """How many features of a pixel are given to it."""
        return self.base.inputs if self.base else self.network.inputs

    def knows(self, image: Rgb) -> bool:
        """Return whether images of the size of one taught it, or what it stands on."""
        own = (self.sizes == image.shape[:2]).all(axis=1).any()
        return bool(own or (self.base and self.base.knows(image)))

    def log_odds(self, values: Values, weight: Values | float) -> Values:
        """Return the weighted mean of both for each pixel of ``(inputs, n)`` features, ``(n,)``.

        The weight, 0 to 1, is the network's: one, or ``(n,)``; the base takes the same.
        """
        if self.base is not None:
            values = np.concatenate([values, self.base.log_odds(values, weight)[None]])
        trees = self.forest.sums(values)
        return trees + weight * (self.network.sums(values) - trees)


def see(settings: TreesSettings, image: Rgb, opinion: Output | None = None) -> tuple[Scene, Values]:
    """Return the scene of ``(H, W, 3)`` uint8 RGB, and its features, ``(F, h, w)`` float32.

    Those of the opinion come last, where the settings ask for it.
    """
    scene = scene_of(image, settings.width, ReferencePatch())
    own = features(scene, settings.features)
    if not settings.opinion:
        return scene, own
    if opinion is None:
        problem = "asks for a stage before it that makes a road mask"
        raise StageError(problem, setting="trees.opinion")
    return scene, np.concatenate([own, opinions(opinion, scene.shape)])


def fit(sample: TrainingSet, settings: TreesSettings, base: Blend | None = None) -> Blend:
    """Grow the trees, and train the network, on the sampled pixels and their mirror images.

    The sample has as many pixels of road as of the rest. Where the frames' share of road is known,
    the classes weigh as much as they have there. What ``base`` says of a pixel is one more feature.
    """
    values = np.concatenate(at_samples(sample, partial(see, settings)))
    if base is not None:
        by_feature = np.ascontiguousarray(values.T)
        known = base.log_odds(by_feature, network_weight(by_feature, settings))
        values = np.column_stack([values, known])
    road = np.concatenate([sample.road, sample.road])
    weights = None if sample.share is None else balanced_back(road, sample.share)
    forest = grow(values, road, weights, settings.trees, sample.seed)
    network = train(values, road, weights, sample.seed)
    sizes = np.unique(np.array([each.shape[:2] for each in sample.images], np.int32), axis=0)
    return Blend(forest, network, sizes, base)


def adapt(known: Blend, sample: TrainingSet, settings: TreesSettings) -> Blend:
    """Learn from a drive's own pixels, on top of what is known already."""
    if known.base is not None:
        raise MisfitError("the model was adapted to a drive already; train it again")
    check_fit(known, settings)
    return fit(sample, settings, known)


def balanced_back(road: Flags, share: float) -> Floats:
    """Return weights ``(n,)`` with mean 1, by which a share of the ``(n,)`` pixels is road."""
    own = road.mean()
    return np.where(road, share / own, (1 - share) / (1 - own))


def check_fit(learnt: Blend, settings: TreesSettings) -> None:
    """Raise a `MisfitError` if the trees were grown on more or fewer features of a pixel."""
    known = len(names_of(settings.features))
    if settings.opinion == (learnt.inputs == known) or learnt.inputs < known:
        raise MisfitError(
            f"the model's trees were grown on {learnt.inputs} features of a pixel, and this "
            f"version computes {known}; train it again"
        )


def network_weight(values: Values, settings: TreesSettings) -> Values | float:
    """Return the network's weight in the mean for ``(F, n)`` features, ``(n,)`` float32.

    Trees that fit their few frames to the last pixel are surer of themselves than they should be,
    by a factor of two or more, and would outvote the network: it has two thirds in the light, and
    one third in the shade, where it misses more road.
    """
    names = names_of(settings.features)
    if LIGHT not in names:
        return IN_LIGHT
    return IN_SHADE + (IN_LIGHT - IN_SHADE) * lit(values[names.index(LIGHT)])


def bind(settings: TreesSettings, learnt: Blend) -> Callable[[View], Output]:
    """Return the trees as a pure function of what they see; a `MisfitError`, see `check_fit`."""
    check_fit(learnt, settings)
    _, share_spec, _ = layers(settings)

    def run(view: View) -> Output:
        shape = view.image.shape
        scene, planes = see(settings, view.image, view.opinion)
        if len(planes) != learnt.inputs:
            raise StageError(
                f"trees: {len(planes)} features of a pixel, and it has learnt from {learnt.inputs}:"
                " the stage before says how probable other classes of road are"
            )
        far, (light,) = reach(scene), light_over(scene, SUNLIT).values()
        weight = settings.reach_weight
        if weight is None:
            weight = OWN_CAMERA if learnt.knows(view.original) else OTHERS
        values = planes.reshape(len(planes), -1)
        odds = learnt.log_odds(values, network_weight(values, settings)).reshape(scene.shape)
        share = stretched(sigmoid(odds - weight * beyond(far, light)), shape)
        codes = np.rint(share * CERTAIN).astype(np.uint16)
        road = Packed.of(codes > round(settings.threshold * CERTAIN))
        shown = (
            Layer(GEODESIC, stretched(far, shape)),
            Layer(share_spec, (codes >> 8).astype(np.uint8)),
            Layer(TREES, road),
        )
        return Output(shown, mask=road, probability=codes)

    return run


def layers(settings: TreesSettings) -> tuple[LayerSpec, ...]:
    """Return the layers; the stage before has a ``probability`` of its own where it is heard."""
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
    oracle=perfect_mask,
    inference_only=("reach_weight", "threshold"),
    hears=lambda settings: settings.opinion,
)
