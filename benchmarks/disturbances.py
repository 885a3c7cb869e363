"""How the methods stand disturbances: ``python -m benchmarks.disturbances --drives FOLDER``.

The presets, a small network and what is tuned on top of it are replayed under six kinds of three
strengths each, on the two drives of CamVid in the folder and the demo. The network, some hundred
weights, learns from the drive of CamVid that it is not scored on (on the demo from the first).
``--write`` puts the table of ``camvid_0016E5`` into ``docs/how-to/disturb.md``. Printed is also
where more strength does less harm. Ten minutes on two cores.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import cv2
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from sklearn.neural_network import MLPClassifier

import roadeval
from benchmarks.drives import Source
from roadeval.config.variants import network_variant
from roadeval.data import IGNORE, ROAD, Frame
from roadeval.evaluation.score.degradation import Degradations
from roadeval.results.facts import Facts

STRENGTHS: Final = {
    "dark": (1, 2, 4),
    "fog": (1, 2, 4),
    "blur": (1, 2, 4),
    "dirt": (1, 2, 4),
    "rain": (1, 2, 4),
    "noise": (1, 2, 3),
}
WIDTH, HEIGHT, NEAR = 96, 72, 9
"""Size of the network's input, and of the square whose mean colour it also sees."""
EVERY: Final = 4
TITLES: Final = {
    "filtered": "`paper`",
    "gated": "`gated`",
    "robust": "`robust`",
    "net": "a small network",
    "net_tuned": "the same, tuned",
}
PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "disturb.md"
BEGIN, END = "<!-- measured: python -m benchmarks.disturbances --write -->\n", "<!-- end -->\n"


def features(image: np.ndarray) -> np.ndarray:
    """Return what the network sees of each pixel: colour, mean colour around it, and its place."""
    small = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) / np.float32(255)
    around = cv2.blur(small, (NEAR, NEAR), borderType=cv2.BORDER_REFLECT)
    return np.concatenate([small, around, _places().transpose(1, 2, 0)], axis=2).reshape(-1, 8)


def _places() -> np.ndarray:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    return np.stack([rows / HEIGHT, columns / WIDTH])


def write_network(path: Path, frames: Sequence[Frame]) -> Path:
    """Fit a network of two layers to labelled frames, and write it as ONNX."""
    seen, roads = [], []
    for frame in frames:
        truth = cv2.resize(frame.truth, (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST).ravel()
        seen.append(features(frame.image)[truth != IGNORE][::5])
        roads.append(truth[truth != IGNORE][::5] == ROAD)
    fitted = MLPClassifier((24,), max_iter=60, tol=1e-3, random_state=0)
    fitted.fit(np.concatenate(seen), np.concatenate(roads))
    values = {"places": _places()[None]}
    for number, (weights, bias) in enumerate(
        zip(fitted.coefs_, fitted.intercepts_, strict=True), 1
    ):
        values[f"w{number}"] = weights.T[..., None, None].astype(np.float32)
        values[f"b{number}"] = bias.astype(np.float32)
    pool = {"kernel_shape": [NEAR] * 2, "pads": [NEAR // 2] * 4, "count_include_pad": 0}
    nodes = [
        helper.make_node("AveragePool", ["image"], ["around"], **pool),
        helper.make_node("Concat", ["image", "around", "places"], ["seen"], axis=1),
        helper.make_node("Conv", ["seen", "w1", "b1"], ["hidden"]),
        helper.make_node("Relu", ["hidden"], ["active"]),
        helper.make_node("Conv", ["active", "w2", "b2"], ["logit"]),
        helper.make_node("Sigmoid", ["logit"], ["road"]),
    ]
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, (1, planes, HEIGHT, WIDTH))
        for name, planes in (("image", 3), ("road", 1))
    ]
    kept = [numpy_helper.from_array(value, name) for name, value in values.items()]
    graph = helper.make_graph(nodes, "road", ends[:1], ends[1:], kept)
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=9), path)
    return path


def measure(drive: Path, labels: Mapping[str, Any], net: Path, every: int) -> Facts:
    """Replay a drive with every method under every disturbance."""
    texts = [f"{kind}:{strength}" for kind, many in STRENGTHS.items() for strength in many]
    config = roadeval.configure(
        {
            "variants": {name: {"preset": name} for name in ("gated", "robust")},
            "labels": labels,
            "frames": {"every": every, "disturb": texts},
            "output": {"record": "none", "figures": False},
        }
    )
    config = config.with_variants([network_variant("net", str(net))]).with_tuned(["net"])
    with TemporaryDirectory() as folder:
        return roadeval.replay(drive, config, reports=Path(folder, "r")).facts


def table(changes: Degradations) -> Iterator[str]:
    """Yield the lines of a table of ERR in percent, a row for each disturbance."""
    shown = {name: changes[name] for name in TITLES}
    yield f"| | {' | '.join(TITLES.values())} |"
    yield f"|---|{'---:|' * len(TITLES)}"
    undisturbed = (next(iter(of.values())).base_ERR for of in shown.values())
    yield f"| undisturbed | {' | '.join(f'{100 * error:.1f}' for error in undisturbed)} |"
    for name, change in next(iter(shown.values())).items():
        errors = (100 * of[name].ERR for of in shown.values())
        yield f"| `{change.text}` | {' | '.join(f'{error:.1f}' for error in errors)} |"


def falls(changes: Degradations) -> Iterator[str]:
    """Yield where a stronger disturbance does less harm than a weaker one, or than none."""
    for name in TITLES:
        by_kind: dict[str, list[tuple[str, float]]] = {}
        for change in changes[name].values():
            steps = by_kind.setdefault(change.kind, [("none", change.base_ERR)])
            steps.append((change.text, change.ERR))
        for steps in by_kind.values():
            for (before, error), (after, later) in pairwise(steps):
                if later < error:
                    yield f"{name}: {before} {100 * error:.2f} %, {after} {100 * later:.2f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=Path, required=True)
    parser.add_argument("--every", type=int, default=EVERY)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    street, park = (args.drives / f"camvid_{name}.mcap" for name in ("0016E5_15hz", "0006R0_1hz"))
    camvid = {"road": [3], "ignore": [11]}
    drives = [(street, camvid, Source(park)), (park, {}, Source(street, (3,), (11,)))]
    demo = PAGE.parents[2] / "recordings" / "demo.mcap"
    drives.append((demo, {}, Source(park)))
    for drive, labels, taught in drives:
        with TemporaryDirectory() as folder:
            net = write_network(Path(folder, "net.onnx"), taught.frames(100))
            facts = measure(drive, labels, net, args.every)
        changes = facts.disturbances
        lines = [*table(changes)]
        print(f"\n{drive.stem}: {facts.frames.evaluated} frames\n", *lines, sep="\n")
        print("\nless harm with more strength:", *falls(changes), sep="\n  ")
        if drive == street and args.write:
            text = PAGE.read_text()
            before, _, rest = text.partition(BEGIN)
            after = rest.partition(END)[2]
            written = "\n".join(lines)
            PAGE.write_text(f"{before}{BEGIN}\n{written}\n\n{END}{after}")


if __name__ == "__main__":
    main()
