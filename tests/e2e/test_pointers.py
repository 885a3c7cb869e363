"""Pointers of Git LFS in place of inputs: one line names the command that fetches them."""

from pathlib import Path

import pytest

from tests.e2e.commands import here
from tests.jobs.making import write_log

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.mcap", "replay a.mcap"),
        ("labels/0000.png", "replay drive.mcap --truth labels"),
        ("labels/0000.txt", "replay drive.mcap --truth labels --road-label road"),
        ("coco.json", "replay drive.mcap --truth coco.json --road-label road"),
        ("cvat.xml", "replay drive.mcap --truth cvat.xml --road-label road"),
        ("masks/0000.png", "replay drive.mcap --masks mine=masks"),
        ("masks/0000.npy", "replay drive.mcap --masks mine=masks"),
        ("net.onnx", "replay drive.mcap --net mine=net.onnx"),
        ("net.toml", "replay drive.mcap --net mine=net.toml"),
        ("run.toml", "replay drive.mcap --config run.toml"),
        ("camera.toml", "replay drive.mcap --camera camera.toml"),
        ("city.model", "replay drive.mcap --model city.model"),
        ("fleet.toml", "fleet fleet.toml -o out"),
        ("out.rrd", "report out.rrd"),
        ("results/summary.json", "report results"),
        ("images/0000.jpg", "pack images -o new.mcap"),
    ],
)
def test_a_pointer_is_told_with_the_command_that_fetches_its_file(
    tmp_path: Path, name: str, words: str
):
    write_log(tmp_path / "drive.mcap")
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(POINTER)
    done = here(*words.split(), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1
    assert f"{Path(name).name}: " in done.stderr
    assert "a pointer to a file in Git LFS: git lfs pull" in done.stderr
