"""Whether networks give the masks that their makers' own code gives, pixel by pixel.

``python -m benchmarks.makers frames RECORDING.rrd FOLDER`` writes 20 frames of a recording;
``python benchmarks/makers.py predict FOLDER`` exports networks with random weights and keeps the
classes that their makers find, by a Python with ultralytics, transformers, onnx and torch but
without roadeval; ``python -m benchmarks.makers compare FOLDER`` counts the pixels that differ.
"""
# ruff: noqa: PLC0415

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

FRAMES: Final = 20
NAMES: Final = ("road", "sidewalk", "building", "wall", "fence", "pole", "sky", "person", "car")
EXPORTS: Final[dict[str, dict[str, Any]]] = {
    "square": {"imgsz": 640},
    "wide": {"imgsz": (384, 640)},
    "any_size": {"imgsz": 640, "dynamic": True},
    "half": {"imgsz": 640, "quantize": 16},
}
"""Exports of Ultralytics."""
SIZES: Final = {"segformer": (512, 512), "segformer_wide": (384, 512)}
"""Height and width of the input of networks of Hugging Face."""


def write_frames(recording: str, folder: Path) -> None:
    """Write frames of a recording, spread over it, as RGB arrays."""
    from roadeval import Recording

    drive = Recording(recording)
    numbers = drive.frame_numbers[:: max(len(drive.frame_numbers) // FRAMES, 1)]
    np.save(folder / "frames.npy", np.stack([drive.image(number) for number in numbers[:FRAMES]]))


def balance(head: Any, scores: Any) -> None:
    """Scale and move the last layer's classes: one half is road, and margins are a few logits."""
    factor = 3 / scores.std(dim=(0, 2, 3))
    shift = (scores * factor[:, None, None]).mean(dim=(0, 2, 3))
    head.weight *= factor[:, None, None, None]
    head.bias.mul_(factor).sub_(shift)
    moved = scores * factor[:, None, None] - shift[:, None, None]
    head.bias[0] -= (moved[:, 0] - moved[:, 1:].amax(1)).median()


def predict_ultralytics(name: str, options: dict[str, Any], frames: Any, folder: Path) -> Any:
    """Export a network of Ultralytics; return the classes that its own predictor finds."""
    import cv2
    import torch
    import ultralytics
    from ultralytics.nn.tasks import SemanticSegmentationModel

    place = Path(ultralytics.__file__).parent / "cfg" / "models" / "26" / "yolo26-sem.yaml"
    shape = ultralytics.utils.YAML.load(place) | {"scale": "n"}
    model = SemanticSegmentationModel(shape, nc=len(NAMES), verbose=False)
    small = np.stack([cv2.resize(frame, (320, 320)) for frame in frames[:6]])
    batch = torch.from_numpy(small).permute(0, 3, 1, 2).float() / 255
    model.train()
    for _ in range(20):  # so that its normalisation fits the frames
        model(batch)
    scores = model.eval()(batch)
    balance(model.model[-1].classifier[1], scores[0] if isinstance(scores, tuple) else scores)
    model.names, model.task = dict(enumerate(NAMES)), "semantic"
    model.args = {"imgsz": 640, "task": "semantic", "batch": 1, "data": None}
    yolo = ultralytics.YOLO("yolo26n-sem.yaml")
    yolo.model, yolo.model.yaml_file = model, f"{name}.yaml"
    Path(yolo.export(format="onnx", simplify=False, **options)).rename(folder / f"{name}.onnx")
    predictor = ultralytics.YOLO(str(folder / f"{name}.onnx"), task="semantic")
    for frame in frames:
        found = predictor.predict(np.ascontiguousarray(frame[..., ::-1]), verbose=False)[0]
        yield np.asarray(found.semantic_mask.data).squeeze()


def predict_hugging_face(name: str, size: tuple[int, int], frames: Any, folder: Path) -> Any:
    """Write a folder of Hugging Face; return the classes that its processor finds."""
    import torch
    from transformers import (
        SegformerConfig,
        SegformerForSemanticSegmentation,
        SegformerImageProcessor,
    )

    numbers = {name: number for number, name in enumerate(NAMES)}
    config = SegformerConfig(id2label=dict(enumerate(NAMES)), label2id=numbers)
    model = SegformerForSemanticSegmentation(config).eval()
    processor = SegformerImageProcessor(size={"height": size[0], "width": size[1]})
    values = processor([*frames[:4]], return_tensors="pt")["pixel_values"]
    for weights in model.parameters():
        weights.mul_(3 if weights.dim() > 1 else 1)
    balance(model.decode_head.classifier, model(values).logits)
    for part in (config, processor):
        part.save_pretrained(folder / name)
    names = {"input_names": ["pixel_values"], "output_names": ["logits"]}
    path = str(folder / name / "model.onnx")
    torch.onnx.export(model, (values[:1],), path, dynamo=False, opset_version=17, **names)
    model.eval()
    for frame in frames:
        output = model(**processor(frame, return_tensors="pt"))
        shapes = [frame.shape[:2]]
        yield processor.post_process_semantic_segmentation(output, target_sizes=shapes)[0].numpy()


def predict(folder: Path) -> None:
    """Export every network, and keep what its makers' code finds."""
    import torch

    frames = np.load(folder / "frames.npy")
    torch.manual_seed(0)
    with torch.no_grad():
        for name, options in EXPORTS.items():
            classes = [*predict_ultralytics(name, options, frames, folder)]
            np.save(folder / f"{name}.npy", np.stack(classes))
        for name, size in SIZES.items():
            classes = [*predict_hugging_face(name, size, frames, folder)]
            np.save(folder / f"{name}.npy", np.stack(classes))


def compare(folder: Path) -> None:
    """Print the share of the pixels that differ: the mean over the frames, and the worst."""
    from roadeval.networks import NetSettings, Network

    frames = np.load(folder / "frames.npy")
    for name in (*EXPORTS, *SIZES):
        path = folder / (f"{name}.onnx" if name in EXPORTS else name)
        network = Network.of(NetSettings(file=str(path)))
        theirs = np.load(folder / f"{name}.npy") == 0
        shares = [
            100 * (network.road(frame).mask.pixels() != road).mean()
            for frame, road in zip(frames, theirs, strict=True)
        ]
        print(f"{name}: {np.mean(shares):.4f} %, at most {max(shares):.4f} %; {network.reading()}")


if __name__ == "__main__":
    part, *places = sys.argv[1:]
    target = Path(places[-1])
    target.mkdir(parents=True, exist_ok=True)
    if part == "frames":
        write_frames(places[0], target)
    else:
        {"predict": predict, "compare": compare}[part](target)
