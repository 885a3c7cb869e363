#!/usr/bin/env bash
# Who encodes AV1 with PyAV as root leaves the thread with the highest real-time priority.
#
# Software: PyAV 18.1.0, whose FFmpeg has SVT-AV1 4.1 as its only encoder of AV1. Linux.
#
# A program writes a clip with the codec `libsvtav1`, as root, which is the usual user in a
# container. Opening the encoder puts the calling thread under SCHED_FIFO with priority 99, and it
# stays so after the encoder is closed and collected. Every thread and every process that is started
# from there inherits it. A pool of an inference library that waits busily then runs before
# everything else on the machine: two such pools on two cores took a test suite from six minutes to
# more than ninety. The encoders of H.264, H.265 and VP9 in the same package change nothing, and
# neither does SVT-AV1 for a user who is not root. `os.sched_setscheduler` with the policy from
# before puts the thread back.
#
# Source: the scheduling policy as `os.sched_getscheduler` returns it, before and after.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
[ "$(id -u)" = 0 ] || { echo "run as root: for other users the encoder changes nothing"; exit 1; }
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check av==18.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON' 2> /dev/null
import gc
import os
import subprocess
import sys
from fractions import Fraction

import av
import numpy as np

PRINTED = "import os; print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)"


def encode(name):
    """Encode four grey frames."""
    encoder = av.CodecContext.create(name, "w")
    encoder.width, encoder.height, encoder.pix_fmt = 320, 240, "yuv420p"
    encoder.framerate, encoder.time_base = 10, Fraction(1, 10)
    for number in range(4):
        frame = av.VideoFrame.from_ndarray(np.full((240, 320, 3), 40 * number, np.uint8))
        frame.pts = number
        encoder.encode(frame)
    encoder.encode(None)


def policy_of_a_new_process():
    answer = subprocess.run([sys.executable, "-c", PRINTED], capture_output=True, check=True)
    return answer.stdout.decode().split()


assert policy_of_a_new_process() == [str(os.SCHED_OTHER), "0"]
for name in ("libx264", "libx265", "libvpx-vp9", "libsvtav1"):
    encode(name)
    gc.collect()
    policy = os.sched_getscheduler(0)
    print(f"after {name}: {'SCHED_FIFO' if policy == os.SCHED_FIFO else 'SCHED_OTHER'}")
    assert (policy == os.SCHED_FIFO) == (name == "libsvtav1")
priority = os.sched_getparam(0).sched_priority
print(f"priority {priority}; a process started now: {policy_of_a_new_process()}")
assert priority == 99
assert policy_of_a_new_process() == [str(os.SCHED_FIFO), "99"]
PYTHON
