#!/usr/bin/env bash
# A mask that was cleared in a Rerun recording is back one row later in a table of the latest values.
#
# Software: rerun-sdk 0.41.0 with datafusion 54.0.0.
#
# A detector logs a road mask in frame 1, loses the road in frame 3 and logs `rr.Clear` there. From
# frame 3 on the entity has no mask, and a viewer shows none. `reader(fill_latest_at=True)` gives a
# table in which each row repeats the latest value of each component. Its row of frame 3 has an empty
# list for the mask. From frame 4 on it has the mask of frame 1 again, and so it has where only one
# later frame is asked for by `using_index_values`. An evaluation of these rows scores a mask that the
# detector had taken back, and a look at the row of the `Clear` itself shows nothing wrong. A mask of
# zeros, logged in place of the `Clear`, stays.
#
# Source: the documentation of the archetype Clear says that a latest-at query "will not return any
# components that were logged at those paths before the clear". Without `fill_latest_at` the mask is
# an empty list in frame 3 and null in frames 4 and 5, and the fill passes over the empty list.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  rerun-sdk==0.41.0 datafusion==54.0.0 pyarrow==26.0.1 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/drive.rrd" <<'PYTHON'
import sys

import numpy as np
import rerun as rr
import rerun.server

print("rerun", rr.__version__)
ROAD = np.ones((1, 2), np.uint8)

stream = rr.RecordingStream("demo", recording_id="drive")
stream.save(sys.argv[1])
for frame in range(6):
    stream.set_time("frame", sequence=frame)
    stream.log("rate", rr.Scalars(frame / 10))  # every frame has a row
    if frame == 1:
        stream.log("cleared", rr.SegmentationImage(ROAD))
        stream.log("zeros", rr.SegmentationImage(ROAD))
    if frame == 3:
        stream.log("cleared", rr.Clear(recursive=False))
        stream.log("zeros", rr.SegmentationImage(0 * ROAD))
stream.flush()
stream.disconnect()


def masks(drives, entity, **options):
    """Return an entity's mask in each row of the table, by the row's frame."""
    column = f"/{entity}:SegmentationImage:buffer"
    table = drives.reader(index="frame", **options).to_arrow_table()
    frames = zip(table["frame"].to_pylist(), table[column].to_pylist())
    values = {frame: value and value[0] for frame, value in sorted(frames)}
    print(f"{entity}, {options}: {values}")
    return values


with rr.server.Server(datasets={"drives": [sys.argv[1]]}) as server:
    drives = server.client().get_dataset(name="drives")
    logged = masks(drives, "cleared")
    assert logged == {0: None, 1: [1, 1], 2: None, 3: [], 4: None, 5: None}
    filled = masks(drives, "cleared", fill_latest_at=True)
    assert filled == {0: None, 1: [1, 1], 2: [1, 1], 3: [], 4: [1, 1], 5: [1, 1]}
    frame_4 = masks(drives, "cleared", fill_latest_at=True, using_index_values=np.array([4]))
    assert frame_4 == {4: [1, 1]}
    zeros = masks(drives, "zeros", fill_latest_at=True)
    assert zeros == {0: None, 1: [1, 1], 2: [1, 1], 3: [0, 0], 4: [0, 0], 5: [0, 0]}
PYTHON
