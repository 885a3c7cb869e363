"""Model files: whatever the bytes, a model that can be used, or a refusal in one line."""

from __future__ import annotations

import io
import zipfile
from functools import cache

from roadeval import configure, save_model
from roadeval.training.learning import fit, from_file
from roadeval.training.settings import TrainingSettings
from tests.compatibility.make import MODEL, unpack, versions
from tests.fuzz.harness import Harness, scratch
from tests.training.making import frame

FILE, PARTS = b"\0", b"\1"
"""The first byte of a case whose rest is the file, or the parts of an archive."""


def check(data: bytes) -> None:
    """Read a model file: these bytes, or an archive of these parts, whose checksums are right."""
    path = scratch() / "city.model"
    kind, data = data[:1], data[1:]
    path.write_bytes(data if kind == FILE else archive(data))
    from_file(path, wanted())


@cache
def wanted():
    """Return pipelines with every stage that learns, and boosted trees that learn at once."""
    trees = {"preset": "robust", "trees": {"trees": 10, "features": ["place"]}}
    return configure({"variants": {"mine": trees, "other": {"preset": "gated"}}}).pipelines()


@cache
def sound() -> bytes:
    """Return a sound model file."""
    path = scratch() / "sound.model"
    save_model(fit([frame(n) for n in range(3)], wanted(), TrainingSettings()), path)
    return path.read_bytes()


def parts(data: bytes) -> bytes:
    """Return the files of an archive one after the other, each behind its length."""
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        files = [(name.encode(), opened.read(name)) for name in opened.namelist()]
    texts = [text for pair in files for text in pair]
    return b"".join(len(text).to_bytes(4, "little") + text for text in texts)


def archive(data: bytes) -> bytes:
    """Return the archive of the files that `parts` gave, whatever became of them."""
    found = []
    while data:
        length = int.from_bytes(data[:4], "little")
        found.append(data[4 : 4 + length])
        data = data[4 + length :]
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as opened:
        for name, content in dict(zip(found[::2], found[1::2], strict=False)).items():
            opened.writestr(name.decode("latin-1").replace("\0", "0") or "0", content)
    return file.getvalue()


def seeds() -> list[bytes]:
    """Return a model file, and its parts."""
    folder = scratch() / "models"
    earlier = [unpack(version, folder).joinpath(MODEL).read_bytes() for version in versions()]
    models = [sound(), *earlier]
    return [*(FILE + model for model in models), *(PARTS + parts(model) for model in models)]


HARNESS = Harness(check, seeds, quick=15)
