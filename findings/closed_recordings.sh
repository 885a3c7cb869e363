#!/usr/bin/env bash
# A closed Rerun recording keeps two threads and its last data; a blueprint that it got, for good.
#
# Software: rerun-sdk 0.41.0.
#
# A service writes a recording for each job in one process: `RecordingStream`, `save`, `log`,
# `disconnect`, and the Python object is collected. Two threads and some two megabytes of each stay
# until the next call of `rerun.init`, so that 100 jobs leave 200 threads and 220 MB.
# `init(..., init_logging=False)` frees them and opens nothing itself. Of a recording that was saved
# with `default_blueprint`, or was sent one, that call leaves two threads more, and the blueprint's
# data: it is copied to a stream in memory that nothing ends. `Blueprint.save` to a file of its own
# leaves none. A process that ends is the only other remedy.
#
# Source: the threads that `/proc/self/task` lists, and VmRSS.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check rerun-sdk==0.41.0
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import gc
import os
import sys

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

COUNT = 30
IMAGE = np.zeros((480, 640, 3), np.uint8)


def record(path, blueprint=None):
    stream = rr.RecordingStream("demo", recording_id=path)
    stream.save(path, default_blueprint=blueprint)
    stream.log("camera", rr.Image(IMAGE))
    stream.flush()
    stream.disconnect()


def resident():
    with open("/proc/self/status") as status:
        (line,) = (line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1000


def left_by(call):
    """Return the threads and megabytes that so many calls leave."""
    call(f"{sys.argv[1]}/first")
    rr.init("demo", init_logging=False)
    threads, size = len(os.listdir("/proc/self/task")), resident()
    for number in range(COUNT):
        call(f"{sys.argv[1]}/{number}")
    gc.collect()
    grown = len(os.listdir("/proc/self/task")) - threads, resident() - size
    rr.init("demo", init_logging=False)
    freed = len(os.listdir("/proc/self/task")) - threads
    print(f"{COUNT} times: {grown[0]} threads, {grown[1]:.0f} MB; after `init` {freed} threads")
    return *grown, freed


threads, size, freed = left_by(record)
assert threads == 2 * COUNT and size > COUNT and freed == 0
threads, _, freed = left_by(lambda path: record(path, rrb.Blueprint()))
assert threads == 4 * COUNT and freed == 2 * COUNT
threads, _, freed = left_by(lambda path: rrb.Blueprint().save("demo", f"{path}.rbl"))
assert freed == 0
PYTHON
