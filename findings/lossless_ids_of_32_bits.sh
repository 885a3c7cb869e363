#!/usr/bin/env bash
# Small ids in an image of uint32 come out of lossless JPEG 2000 as others, by up to 67 million.
#
# Software: imagecodecs 2026.3.6 (with OpenJPEG 2.5.4 in its wheel), numpy 2.4.6.
#
# `imagecodecs.jpeg2k_encode(image)` is lossless by default, and takes images of uint32. An image of
# instance ids below 65,536, in blocks of 16x16 pixels as objects are, comes back with 1 or 2 % of
# its pixels wrong, along the edges of objects: an id of some thousands becomes one near 67 million.
# Ids below 256 are not safe, either. Nothing is raised, type and size are right, and so are most
# objects; a count of them grows. All values are moved by 2^31 before the wavelets, as all bits of
# the type may be used, and at steps the wavelets need bits beyond those that the coder keeps. Noise
# of the same range comes back right, and so does int32 of up to 20 bits: a test with random numbers
# shows nothing. The same ids as uint16 are right, and so are High-Throughput JPEG 2000
# (`htj2k_encode`) and `lerc_encode` of the same uint32.
#
# Source: the numbers before and after. The documentation of `jpeg2k_encode` names no limit for the
# type; issue 153 of cgohlke/imagecodecs (August 2026, of lossy encoding) says that uint32 without
# loss is exact.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  imagecodecs==2026.3.6 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import imagecodecs
import numpy as np

print(f"imagecodecs {imagecodecs.__version__}, {imagecodecs.jpeg2k_version()}")
random = np.random.default_rng(0)


def back(image, codec="jpeg2k"):
    encoded = getattr(imagecodecs, f"{codec}_encode")(image)
    decoded = getattr(imagecodecs, f"{codec}_decode")(encoded)
    assert decoded.dtype == image.dtype
    assert decoded.shape == image.shape
    return decoded


def blocks(limit, kind):
    """Objects of 16x16 pixels with ids below a limit."""
    ids = random.integers(0, limit, (30, 40)).astype(kind)
    return np.kron(ids, np.ones((16, 16), kind))


for limit in (256, 2**16, 2**20, 2**28):
    ids = blocks(limit, np.uint32)
    decoded = back(ids)
    wrong = decoded != ids
    error = np.abs(decoded.astype(np.int64) - ids)
    print(f"  uint32, ids below {limit:,}: {wrong.mean():.1%} wrong, by up to {error.max():,}")
    assert wrong.any()
    assert error.max() > 2**25
    for codec in ("htj2k", "lerc"):
        assert np.array_equal(back(ids, codec), ids)

ids = blocks(2**16, np.uint32)
assert ids.max() < 2**16
decoded = back(ids)
example = np.argwhere(decoded > 2**20)[0]
print(f"  for example {ids[tuple(example)]} becomes {decoded[tuple(example)]}")
objects = len(np.unique(ids)), len(np.unique(decoded))
print(f"  {objects[0]} objects before, {objects[1]} after")
assert objects[1] > objects[0]
assert 0.001 < (decoded != ids).mean() < 0.3

assert np.array_equal(back(ids.astype(np.uint16)), ids)
print("  the same ids as uint16: none wrong")
noise = random.integers(0, 2**16, ids.shape).astype(np.uint32)
print(f"  uint32, noise below 65,536: {(back(noise) != noise).mean():.1%} wrong")
assert np.array_equal(back(noise), noise)
for limit in (2**16, 2**20, 2**27):
    signed = blocks(limit, np.int32)
    wrong = (back(signed) != signed).mean()
    print(f"  int32, ids below {limit:,}: {wrong:.1%} wrong")
    assert (wrong > 0) == (limit == 2**27)
PYTHON
