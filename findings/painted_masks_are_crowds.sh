#!/usr/bin/env bash
# Datumaro writes every mask painted in CVAT as a crowd to COCO, and pycocotools does not score crowds.
#
# Software: datumaro 1.13.12 and pycocotools 2.0.11, with a file as CVAT 1.1 for images.
#
# Six images have the same road: in three of them it was drawn as a polygon, in three it was painted
# with the brush. `export` to `coco_instances` gives the polygons `iscrowd` 0 and the painted masks
# `iscrowd` 1, though one road was painted, and the file from CVAT says nothing of crowds. By the COCO
# format that means "a group of objects; do not count it". `COCOeval` then asks for three roads, not
# six: a network that misses each painted road has an AP and a recall of 1. Where all are painted,
# both are -1, which is "no truth". Loaders that skip crowds train on the polygons alone.
#
# `segmentation_mode="polygons"` writes `iscrowd` 0 for all; its outlines run through the centres of
# the border's pixels, and the area of a painted road is 2,291 there, not 2,400.
# `segmentation_mode="mask"` makes crowds of the polygons, too. To keep masks as they are, set
# `iscrowd` in the file oneself.
#
# Source: `is_crowd = mask is not None` in datumaro/plugins/data_formats/coco/exporter.py. Its page on
# COCO says of the attribute `is_crowd` that it "indicates that the annotation covers multiple
# instances of the same class".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  datumaro==1.13.12 pycocotools==2.0.11 pillow==12.0.0 numpy==2.2.6
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import contextlib
import io
import json
from importlib.metadata import version
from pathlib import Path

from datumaro.components.dataset import Dataset
from PIL import Image
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

print(", ".join(f"{name} {version(name)}" for name in ("datumaro", "pycocotools")))
POLYGON = '<polygon label="road" occluded="0" points="0,20;80,20;80,50;0,50" z_order="0"/>'
PAINTED = (
    '<mask label="road" occluded="0" rle="0, 2400" left="0" top="20" width="80" height="30" '
    'z_order="0"/>'
)


def exported(name, shapes, **options):
    """Return the path of the COCO file of images with these shapes, one in each."""
    source = Path(name, "cvat")
    (source / "images").mkdir(parents=True)
    images = ""
    for number, shape in enumerate(shapes):
        Image.new("RGB", (80, 60)).save(source / "images" / f"{number}.png")
        images += f'<image id="{number}" name="{number}.png" width="80" height="60">{shape}</image>'
    (source / "annotations.xml").write_text(
        "<annotations><version>1.1</version><meta><task><labels><label><name>road</name>"
        "<attributes></attributes></label></labels></task></meta>" + images + "</annotations>"
    )
    dataset = Dataset.import_from(str(source), "cvat")
    dataset.export(f"{name}/coco", "coco_instances", save_media=False, **options)
    (path,) = Path(name, "coco").rglob("*.json")
    return path


def crowds(path):
    data = json.loads(path.read_text())
    return [(annotation["iscrowd"], annotation["area"]) for annotation in data["annotations"]]


def scores(path, images):
    """Return AP and recall of a network that has the truth in these images and nothing in others."""
    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO(str(path))
        predictions = []
        for annotation in truth.dataset["annotations"]:
            if annotation["image_id"] in images:
                run_lengths = truth.annToRLE(annotation)
                prediction = {key: annotation[key] for key in ("image_id", "category_id")}
                counts = run_lengths["counts"].decode()
                prediction["segmentation"] = {"size": run_lengths["size"], "counts": counts}
                predictions.append(prediction | {"score": 0.9})
        evaluation = COCOeval(truth, truth.loadRes(predictions), "segm")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return round(float(evaluation.stats[0]), 2), round(float(evaluation.stats[8]), 2)


mixed = exported("mixed", [POLYGON] * 3 + [PAINTED] * 3)
print("iscrowd and area of three polygons and three painted masks:", crowds(mixed))
print("AP and recall of a network that misses the painted ones:", scores(mixed, {1, 2, 3}))
assert crowds(mixed) == [(0, 2400)] * 3 + [(1, 2400)] * 3
assert scores(mixed, {1, 2, 3}) == (1, 1)

painted = exported("painted", [PAINTED] * 3)
print("all painted, all right:", scores(painted, {1, 2, 3}))
assert scores(painted, {1, 2, 3}) == (-1, -1)

polygons = exported("polygons", [POLYGON] * 3 + [PAINTED] * 3, segmentation_mode="polygons")
print("segmentation_mode='polygons':", crowds(polygons), scores(polygons, {1, 2, 3}))
assert crowds(polygons) == [(0, 2400)] * 3 + [(0, 2291)] * 3
assert scores(polygons, {1, 2, 3}) == (0.5, 0.5)
masks = exported("masks", [POLYGON] * 3 + [PAINTED] * 3, segmentation_mode="mask")
assert crowds(masks) == [(1, 2400)] * 6
PYTHON
