#!/usr/bin/env bash
# A perfect prediction of a Label Studio export has an AP of 0.64 by pycocotools, as ids begin with 0.
#
# Software: label-studio-sdk 2.1.2 and pycocotools 2.0.11.
#
# Five images with one road each are exported as COCO. The ids of images, annotations and classes
# begin with 0, which the format allows. The exported masks themselves, as predictions, have an
# AP of 0.64 and a recall of 0.80 by `COCOeval`, which have to be 1: it writes the id of the matched
# annotation to an array of zeros and takes 0 for "no match". So the first annotation counts as
# missed, and the prediction of it as false. With one image the AP is 0, with five hundred one in
# five hundred objects is lost, which nobody sees, and two models whose first image differs are not
# compared on it. Ids of images and of classes may be 0. One added to the ids of the annotations gives
# an AP of 1.
#
# Source: `evaluateImg` in pycocotools/cocoeval.py fills `dtm` and `gtm` with zeros and ids, and
# `accumulate` asks for `logical_not`; pull request 332 of cocodataset/cocoapi, open since 2019, mends
# it there. label_studio_sdk/converter/converter.py numbers annotations by `len(annotations)`.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  label-studio-sdk==2.1.2 pycocotools==2.0.11
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import contextlib
import io
import json
from importlib.metadata import version
from pathlib import Path

from label_studio_sdk.converter import Converter
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

print(", ".join(f"{name} {version(name)}" for name in ("label-studio-sdk", "pycocotools")))
CONFIG = (
    '<View><Image name="image" value="$image"/><PolygonLabels name="tag" toName="image">'
    '<Label value="road"/></PolygonLabels></View>'
)


def exported(count):
    """Return the COCO data of a project of so many images, with one road in each."""
    result = {
        "type": "polygonlabels",
        "from_name": "tag",
        "to_name": "image",
        "original_width": 80,
        "original_height": 60,
        "value": {
            "points": [[0, 40], [100, 40], [100, 90], [0, 90]],
            "polygonlabels": ["road"],
        },
    }
    tasks = [
        {"id": n, "data": {"image": f"{n}.png"}, "annotations": [{"id": n, "result": [result]}]}
        for n in range(1, count + 1)
    ]
    Path("tasks.json").write_text(json.dumps(tasks))
    place = f"coco_{count}"
    converter = Converter(CONFIG, ".", download_resources=False)
    converter.convert("tasks.json", place, "COCO", is_dir=False)
    return json.loads(Path(place, "result.json").read_text())


def scores(data):
    """Return the AP and the recall of the masks in the data against themselves."""
    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        truth.dataset = data
        truth.createIndex()
        predictions = []
        for annotation in data["annotations"]:
            run_lengths = truth.annToRLE(annotation)
            counts = run_lengths["counts"].decode()
            prediction = {key: annotation[key] for key in ("image_id", "category_id")}
            prediction["segmentation"] = {"size": run_lengths["size"], "counts": counts}
            predictions.append(prediction | {"score": 0.9})
        evaluation = COCOeval(truth, truth.loadRes(predictions), "segm")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return round(float(evaluation.stats[0]), 2), round(float(evaluation.stats[8]), 2)


for count, expected in ((1, (0, 0)), (5, (0.64, 0.8))):
    data = exported(count)
    parts = "images", "annotations", "categories"
    ids = {part: [entry["id"] for entry in data[part]] for part in parts}
    as_exported = scores(data)
    for annotation in data["annotations"]:
        annotation["id"] += 1
    from_one = scores(data)
    print(f"{count} images, ids {ids}: AP and recall {as_exported}; annotations from 1: {from_one}")
    assert all(numbers[0] == 0 for numbers in ids.values())
    assert as_exported == expected
    assert from_one == (1, 1)
PYTHON
