#!/usr/bin/env bash
# torchvision turns white, 1.0, into 0 where a picture of floats becomes one of uint16.
#
# Software: torchvision 0.29.1 with torch 2.14.1, its transforms v2; numpy 2.4.6. x86-64.
#
# `v2.ToDtype(dtype, scale=True)` takes a picture of 0 to 1 to the whole range of a type of whole
# numbers. 1.0 becomes 255 for uint8 and 32767 for int16, and 0 for uint16: each pixel of at least
# 0.999993 is black, and its neighbour of 0.9999 is 65529. It multiplies by 65536 less 0.001, which
# is 65536 itself in float32, and the conversion wraps. So a mask or a normalised thermal, depth or
# 16-bit picture that is written for a file has holes where it is brightest. `adjust_gamma` with the
# gamma 1 and `adjust_hue` by 0, which change nothing, take the same way there and back, and make
# 65535 black in a picture of uint16. Nothing is raised, as it is for int32 ("cannot be performed
# safely"). The way from uint8 to uint16 makes 255 to 65280, and the way back from uint16 to floats
# is right.
#
# `resize` of uint16 with BICUBIC, with and without antialias, has the like: what overshoots beside
# an edge from 0 to 60000 is 63427 on the dark side, where the right value is 0, and 792 on the
# bright side. For uint8 the same call ends at 0 and 255. Convert to float32 first and, at the end,
# multiply by 65535 and round.
#
# Source: `to_dtype_image` in torchvision/transforms/v2/functional/_misc.py: `max_value + 1.0 - eps`
# with an eps of 1e-3; `resize_image` in _geometry.py, whose clamp is for uint8 alone. The
# documentation of both has no word of uint16; pull request 8524 of pytorch/vision brought the type.
# (The script downloads some gigabytes.)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  torch==2.14.1 torchvision==0.29.1 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import numpy as np
import torch
import torchvision
from torchvision.transforms import InterpolationMode, v2
from torchvision.transforms.v2 import functional

print(f"torchvision {torchvision.__version__}, torch {torch.__version__}")


def picture(levels, dtype):
    return torch.tensor(levels).to(dtype).reshape(1, 1, -1).repeat(3, 1, 1)


levels = [0.0, 0.25, 0.9, 0.9999, 1.0]
highest = {torch.uint8: 255, torch.int16: 32767, torch.uint16: 65535}
for dtype, white in highest.items():
    got = v2.ToDtype(dtype, scale=True)(picture(levels, torch.float32))[0, 0].tolist()
    print(f"  {levels} as {dtype}: {got}")
    assert all(abs(g - level * white) <= 1 for g, level in zip(got[:-1], levels, strict=False))
    assert got[-1] == (0 if dtype == torch.uint16 else white)

# A thermal picture from 0 to 1 that is stored with 16 bits: the hottest place is black.
heat = torch.clamp(torch.linspace(0, 1.2, 120), max=1).reshape(1, 1, -1).repeat(1, 90, 1)
stored = v2.ToDtype(torch.uint16, scale=True)(heat)
hot = (stored.to(torch.int64) > 0.9 * 65535).float().mean()
print(f"  hotter than 0.9: {(heat > 0.9).float().mean():.0%} of the floats, {hot:.0%} as uint16")
assert (heat > 0.9).float().mean() > 0.2
assert hot < 0.1

counts = picture([0, 40000, 65534, 65535], torch.uint16)
for name, changed in {
    "adjust_gamma(1)": functional.adjust_gamma(counts, 1.0),
    "adjust_hue(0)": functional.adjust_hue(counts, 0.0),
}.items():
    print(f"  {name} of {counts[0, 0].tolist()}: {changed[0, 0].tolist()}")
    assert changed[0, 0].tolist()[-1] == 0
    assert changed[0, 0].tolist()[1] == 40000
assert v2.ToDtype(torch.float32, scale=True)(counts)[0, 0, -1] == 1
assert v2.ToDtype(torch.uint16, scale=True)(picture([255], torch.uint8)).flatten()[0] == 65280

# An edge from 0 to 60000, made twice as large: uint16 against the same as floats.
edge = torch.zeros(1, 16, 16)
edge[..., 8:] = 60000
for antialias in (True, False):

    def larger(image, antialias=antialias):
        size, cubic = [32, 32], InterpolationMode.BICUBIC
        return functional.resize(image, size, interpolation=cubic, antialias=antialias)[0, 9, 11:21]

    want = larger(edge).clamp(0, 65535)
    got = larger(edge.to(torch.uint16))
    bytes_ = larger((edge / 60000 * 250).to(torch.uint8))
    print(f"  BICUBIC, antialias {antialias}: uint16 {got.tolist()}")
    print(f"    floats {[round(w) for w in want.tolist()]}, uint8 {bytes_.tolist()}")
    error = (got.to(torch.float32) - want).abs()
    assert error.max() > 60000
    assert np.allclose(bytes_ / 255, (larger(edge) / 60000 * 250).clamp(0, 255) / 255, atol=0.01)
PYTHON
