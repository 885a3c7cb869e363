#!/usr/bin/env bash
# A mask that was cleared in a Rerun recording comes back one row later in a table that fills gaps.
#
# Software: rerun-sdk 0.41.0 with its extra `catalog` (DataFusion 54.0.0).
#
# A recorder logs a mask at frame 1, and `Clear` at frame 3, as where a detection ends or a camera
# fails. The documentation of `Clear` says that a latest-at query does not return what was logged on
# the path before it. `dataset.reader(index="frame", fill_latest_at=True)` puts the latest value into
# the rows without one, and is how the rows of several cameras are brought together. It gives the mask
# for frames 1 and 2, an empty list for frame 3, and the mask again for frames 4, 5 and every later
# one. Asked for frame 4 alone by `using_index_values`, it gives the mask without a trace of the clear.
# A table for an evaluation thus has stale masks on every frame after a clear, and a test whose last
# frame is the cleared one passes. Clearing recursively is alike. `include_tombstone_columns=True` adds
# a column that says where a clear was, by which the masks after it can be taken out by hand.
#
# Source: the rows of the table; the docstring of rerun.archetypes.Clear. Rerun's pull request 7652
# (October 2024) was to make such tables obey clears.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  "rerun-sdk[catalog]==0.41.0" datafusion==54.0.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
import rerun as rr

FRAMES, SEEN, CLEARED = 8, 1, 3
MASK = "/camera/mask:SegmentationImage:buffer"


def record(path, recursive):
    stream = rr.RecordingStream("demo")
    stream.save(path)
    for frame in range(FRAMES):
        stream.set_time("frame", sequence=frame)
        stream.log("camera", rr.Scalars(frame))
        if frame == SEEN:
            stream.log("camera/mask", rr.SegmentationImage(np.full((2, 2), 7, np.uint8)))
        if frame == CLEARED:
            stream.log("camera/mask", rr.Clear(recursive=recursive))
    stream.flush()
    stream.disconnect()


def masks(dataset, **options):
    """Return by frame whether the table has the mask, an empty list or nothing."""
    table = dataset.reader(index="frame", **options).to_arrow_table().to_pydict()
    words = {None: "nothing", 0: "empty", 1: "mask"}
    cells = (None if cell is None else len(cell) for cell in table[MASK])
    return dict(sorted(zip(table["frame"], (words[cell] for cell in cells))))


print("rerun-sdk", version("rerun-sdk"), "datafusion", version("datafusion"))
stored = dict.fromkeys(range(FRAMES), "nothing") | {SEEN: "mask", CLEARED: "empty"}
filled = dict.fromkeys(range(FRAMES), "mask") | {0: "nothing", CLEARED: "empty"}
for recursive in (False, True):
    record("drive.rrd", recursive)
    with rr.server.Server(datasets={"drive": ["drive.rrd"]}) as server:
        dataset = server.client().get_dataset("drive")
        as_stored = masks(dataset)
        with_fill = masks(dataset, fill_latest_at=True)
        alone = masks(dataset, fill_latest_at=True, using_index_values=np.array([CLEARED + 1]))
    print(f"recursive {recursive}: as stored {as_stored}")
    print(f"  filled {with_fill}")
    print(f"  frame {CLEARED + 1} alone {alone}")
    assert as_stored == stored
    assert with_fill == filled
    assert alone == {CLEARED + 1: "mask"}
PYTHON
