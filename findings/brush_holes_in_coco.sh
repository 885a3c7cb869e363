#!/usr/bin/env bash
# Label Studio's COCO export of a brush mask fills its holes; its PNG export of the same keeps them.
#
# Software: label-studio-sdk 2.1.2, read back by pycocotools 2.0.11.
#
# A road is painted with the brush, and a car on it is left out, 20 x 10 pixels. The export as PNG is
# the mask as it was painted. The export as COCO has one polygon, the outline: the car is road there.
# Nothing in the file (`iscrowd`, a second ring) tells of a hole, and `area` counts it, too. As the
# outline runs through the centres of the border's pixels, `area` is smaller than the outline's 2,400
# pixels by half the border: 2,291, which is not far from the 2,200 that were painted.
#
# For the truth of a segmentation, export brush masks as PNG, or as JSON with their run lengths.
#
# Source: label_studio_sdk/converter/exports/brush_to_coco.py asks cv2.findContours for RETR_EXTERNAL,
# which gives outer borders alone.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  label-studio-sdk==2.1.2 pycocotools==2.0.11
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import json
from pathlib import Path

import numpy as np
from label_studio_sdk.converter import Converter
from label_studio_sdk.converter.brush import mask2rle
from PIL import Image
from pycocotools.coco import COCO

CONFIG = (
    '<View><Image name="image" value="$image"/><BrushLabels name="tag" toName="image">'
    '<Label value="road"/></BrushLabels></View>'
)
road = np.zeros((60, 80), bool)
road[20:50, 0:80] = True
car = np.zeros_like(road)
car[25:35, 30:50] = True
painted = road & ~car

result = {
    "type": "brushlabels",
    "from_name": "tag",
    "to_name": "image",
    "original_width": 80,
    "original_height": 60,
    "value": {
        "format": "rle",
        "rle": mask2rle(np.uint8(255) * painted),
        "brushlabels": ["road"],
    },
}
task = {"id": 1, "data": {"image": "a.png"}, "annotations": [{"id": 1, "result": [result]}]}
Path("tasks.json").write_text(json.dumps([task]))
Path("png").mkdir()
converter = Converter(CONFIG, ".", download_resources=False)
converter.convert("tasks.json", "png", "BRUSH_TO_PNG", is_dir=False)
converter.convert("tasks.json", "coco", "BRUSH_TO_COCO", is_dir=False)

(picture,) = Path("png").glob("*.png")
as_png = np.array(Image.open(picture)) > 0
coco = COCO("coco/result_coco.json")
(annotation,) = coco.loadAnns(coco.getAnnIds())
as_coco = coco.annToMask(annotation) > 0
print(f"painted {painted.sum()}; in the PNG {as_png.sum()}, of the car {as_png[car].sum()}")
print(
    f"COCO: {len(annotation['segmentation'])} polygon, {as_coco.sum()} pixels, of the car "
    f"{as_coco[car].sum()}, area {annotation['area']}, iscrowd {annotation['iscrowd']}"
)
assert np.array_equal(as_png, painted)
assert len(annotation["segmentation"]) == 1
assert as_coco[car].all() and car.sum() == 200
assert (annotation["iscrowd"], annotation["area"]) == (0, 2291)
PYTHON
