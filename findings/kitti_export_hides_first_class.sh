#!/usr/bin/env bash
# Datumaro's export to KITTI writes the first class with 0, the value of all pixels without a label.
#
# Software: datumaro 1.13.12 with numpy 2.4.6, its format `kitti_segmentation`.
#
# A frame has a road, a car on it, and ground without a label; the classes are road and car, in this
# order. The exports to Pascal VOC, Cityscapes and CamVid put a class `background` before them, so
# that road is 1. The export to KITTI does not: road is 0, and so is the ground. The label images
# (`semantic`), and the black of the pictures (`semantic_rgb`), no longer tell where the road was.
# Imported again, the dataset has a road everywhere but on the car. Nothing is said. With another
# order of the classes it is the car that is lost, which shows less: whether a class survives depends
# on its place in the list. `instance` still has the road, as 256 times 0 plus its number.
#
# A class `background` at the first place, which no annotation has, keeps all others.
#
# Source: the values of the images. KITTI's own class 0 is "unlabeled", by the list of its classes in
# datumaro/plugins/data_formats/kitti/format.py; the exporter beside it takes the classes of the dataset
# as they are. That of voc puts a background before them. The page on the format says nothing of it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  datumaro==1.13.12 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - 2>/dev/null <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import numpy as np
from datumaro import Dataset, DatasetItem, Image, Mask
from PIL import Image as Picture

HEIGHT, WIDTH = 48, 64
road, car = np.zeros((2, HEIGHT, WIDTH), bool)
road[24:, 10:50] = True
car[28:36, 20:36] = True
visible = {"road": road & ~car, "car": car}


def exported(kind, classes):
    """Export the frame, and return the folder."""
    masks = [
        Mask(area, label=classes.index(name), id=number, group=number, z_order=number)
        for number, (name, area) in enumerate([("road", road), ("car", car)], 1)
    ]
    picture = Image.from_numpy(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    item = DatasetItem("frame", subset="train", media=picture, annotations=masks)
    path = "_".join([kind, *classes])
    Dataset.from_iterable([item], categories=classes).export(path, kind, save_media=True)
    return path


def imported(kind, classes):
    """Return the pixels of each class after an export and an import."""
    dataset = Dataset.import_from(exported(kind, classes), kind)
    names = [label.name for label in dataset.categories()[next(iter(dataset.categories()))]]
    areas = {name: np.zeros((HEIGHT, WIDTH), bool) for name in names}
    for item in dataset:
        for annotation in item.annotations:
            if hasattr(annotation, "image"):
                areas[names[annotation.label]] |= annotation.image.astype(bool)
    return {name: int(areas[name].sum()) for name in ("road", "car")}


expected = {name: int(area.sum()) for name, area in visible.items()}
print(f"datumaro {version('datumaro')}, drawn: {expected} of {HEIGHT * WIDTH} pixels")
for kind, classes in (
    ("cityscapes", ["road", "car"]),
    ("kitti_segmentation", ["road", "car"]),
    ("kitti_segmentation", ["car", "road"]),
    ("kitti_segmentation", ["background", "road", "car"]),
):
    result = imported(kind, classes)
    print(f"{kind} with {', '.join(classes)}: {result}")
    lost = classes[0] if kind.startswith("kitti") else ""
    for name in expected:
        others = sum(pixels for other, pixels in expected.items() if other != name)
        wanted = HEIGHT * WIDTH - others if name == lost else expected[name]
        assert result[name] == wanted, (kind, classes, name)

path = Path("kitti_segmentation_road_car/train/semantic/frame.png")
labels = np.array(Picture.open(path))
values = [np.unique(labels[area]).tolist() for area in (visible["road"], ~road)]
print(f"values of the road: {values[0]}, of the ground: {values[1]}")
assert values == [[0], [0]]
PYTHON
