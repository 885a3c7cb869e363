#!/usr/bin/env bash
# PyAV gives another picture, up to two levels darker, for a video whose height is odd.
#
# Software: PyAV 15.1.0 and 18.1.0, with the FFmpeg in their wheels; with numpy 2.4.6.
#
# A decoded frame is YUV 4:2:0, and `to_ndarray(format="rgb24")` turns it into RGB by FFmpeg's
# libswscale. For an even height that takes a fast way, which rounds down: greys are half a level too
# dark on average. For an odd height, such as 479 or 1079, it takes the general way for scaling: greys
# are 1.8 levels too dark on average, and up to 2.3. Only the frame's own height decides: a camera whose
# last row was cropped away has other values on all its other rows, too. Colours that were learnt from
# one and looked up in the other, thresholds and golden pictures do not fit. An odd width changes
# nothing. With an odd height "bgr24" is 1.3 levels brighter than "rgb24" of the same frame.
#
# Source: PyAV's documentation of `to_ndarray` and `reformat` names no difference; values are compared
# with the conversion of ITU-R BT.601, limited range, computed here.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 15.1.0 18.1.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    av==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import av
import numpy as np

HEIGHT, WIDTH = 480, 640
luma = np.random.default_rng(0).integers(16, 236, (HEIGHT, WIDTH)).astype(np.uint8)
grey = np.full((HEIGHT // 2, WIDTH // 2), 128, np.uint8)


def rgb(height, width, planes, order="rgb24"):
    """Return the upper left part of a YUV 4:2:0 frame as RGB, ``(height, width, 3)``."""
    frame = av.VideoFrame(width, height, "yuv420p")
    for plane, values in zip(frame.planes, planes):
        rows = np.zeros((plane.height, plane.line_size), np.uint8)
        rows[:, : plane.width] = values[: plane.height, : plane.width]
        plane.update(rows)
    pixels = frame.to_ndarray(format=order).astype(int)
    return pixels[..., ::-1] if order == "bgr24" else pixels


print("PyAV", av.__version__)
exact = (luma - 16.0) * 255 / 219
bias = {}
for height, width in ((480, 640), (480, 639), (479, 640)):
    for order in ("rgb24", "bgr24"):
        pixels = rgb(height, width, (luma, grey, grey), order)
        bias[height, width, order] = (pixels - exact[:height, :width, None]).mean()
        told = f"{bias[height, width, order]:+.2f} levels on grey"
        print(f"height {height}, width {width}, {order}: {told}")
        is_dark = (height, order) == (479, "rgb24")
        assert -1.9 < bias[height, width, order] < -1.6 if is_dark else True
        assert is_dark or -0.6 < bias[height, width, order] < -0.4

whole, cropped = (rgb(height, WIDTH, (luma, grey, grey)) for height in (480, 479))
changed = np.mean((whole[:479] != cropped).any(-1))
print(f"without the last row, {changed:.0%} of the other pixels are changed")
assert changed > 0.9
PYTHON
done
