"""A fleet's folder from elsewhere writes nothing outside, asks nobody, and tells no password."""

import json
import os
import shutil
import sys
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import parquet

import roadeval
from roadeval.fleet import remote
from roadeval.recording import viewer
from roadeval.results.facts import digest_of
from roadeval.runtime.files import claim
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here, write
from tests.fleet.serving import Server

PASSWORD = "geheim"
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
CHANGES = ("os.remove", "os.rmdir", "os.mkdir", "os.rename", "os.link", "os.symlink", "os.truncate")
_watching: list[list[tuple[str, str]]] = []


def _hook(event, arguments):
    """Note what is written and where a connection leads, while somebody looks."""
    if not _watching:
        return
    seen = _watching[-1]
    if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
        kind = "written" if arguments[2] & WRITES else "read"
        seen.append((kind, os.path.realpath(os.fsdecode(arguments[0]))))
    elif event in CHANGES:
        names = [each for each in arguments[:2] if isinstance(each, str | bytes | os.PathLike)]
        seen.extend(("written", os.path.realpath(os.fsdecode(each))) for each in names)
    elif event == "socket.connect":
        seen.append(("connected", str(arguments[1])))


sys.addaudithook(_hook)


@contextmanager
def watched():
    """Yield what this process writes, and to whom it connects."""
    _watching.append([])
    try:
        yield _watching[-1]
    finally:
        _watching.pop()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A fleet of two drives, none of whose recordings was kept."""
    home = tmp_path_factory.mktemp("theirs")
    for place, name in enumerate("ab"):
        write(home / "logs" / f"{name}.mcap", 100 * place)
    config = roadeval.configure({"training": {"frames": 4}})
    roadeval.replay_fleet([home / "logs"], home / "f", config, executor=Here())
    for ending in ("pdf", "html"):  # libraries make their caches
        here("report", home / "f", "-o", home / f"warm.{ending}")
    return home / "f"


@pytest.fixture
def fleet(made, tmp_path, monkeypatch):
    """The same, to be changed, in a folder of its own; a viewer that draws nothing."""
    monkeypatch.setattr(viewer, "screenshot", lambda recording, picture, frame: frame)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "kept.txt").write_text("mine")
    shutil.copytree(made, tmp_path / "f")
    return tmp_path / "f"


def first(fleet):
    return parquet.read_table(fleet / "worst.parquet")["drive"][0].as_py()


def change(fleet, column, value, *, of="drives"):
    """Give every row of a table another value, as somebody can who writes the file by hand."""
    path = fleet / f"{of}.parquet"
    table = parquet.read_table(path)
    place = table.schema.get_field_index(column)
    cells = pa.array([value] * len(table), table.schema.field(place).type)
    parquet.write_table(table.set_column(place, column, cells), path)


def called(fleet, name, *, summary=True):
    """Call the first drive otherwise: in the tables, and in the summary unless told otherwise."""
    was = first(fleet)
    for path in fleet.glob("*.parquet"):
        table = parquet.read_table(path)
        place = table.schema.get_field_index("drive")
        cells = [name if each == was else each for each in table["drive"].to_pylist()]
        parquet.write_table(table.set_column(place, "drive", pa.array(cells)), path)
    if not summary:
        return
    content = json.loads((fleet / "fleet.json").read_text())
    for each in content["drives"]:
        each["drive"] = name if each["drive"] == was else each["drive"]
    content["digest"] = digest_of(content, content["digest"]["parts"])
    (fleet / "fleet.json").write_text(json.dumps(content))


def outside(folder):
    """All that lies in the folder above, the fleet's own left out."""
    found = (path for path in folder.parent.rglob("*") if not path.is_relative_to(folder))
    return {path: path.read_bytes() for path in found if path.is_file()}


def looked_into(fleet):
    """Do everything with a fleet that reads one; return codes, messages and what was seen."""
    before = outside(fleet)
    with watched() as seen:
        runs = {
            "worst": here("inspect", fleet, "--worst", 1, "--screenshot", "mine/a.png"),
            "list": here("inspect", fleet, "--list", "--json"),
            "report": here("report", fleet),
            "page": here("report", fleet, "-o", fleet / "page.html"),
            "compare": here("compare", fleet, fleet),
        }
    assert outside(fleet) == before
    temporary = Path("/tmp")
    elsewhere = [
        path
        for kind, path in seen
        if kind == "written"
        and not Path(path).is_relative_to(fleet.parent)
        and not Path(path).is_relative_to(temporary)
        and not path.startswith("/dev/")
    ]
    assert elsewhere == []
    said = "".join(run.stdout + run.stderr for run in runs.values())
    return runs, said, seen


@pytest.mark.parametrize(
    "name", ["{}/mine/x", "../../mine/x", "..", "a/../../../mine/x", "x\0y", "C:x", "n" * 300, ""]
)
def test_a_drives_name_is_no_path(fleet, name):
    called(fleet, name.format(fleet.parent))
    runs, said, _ = looked_into(fleet)
    assert runs["worst"].returncode == 1
    assert "no name" in runs["worst"].stderr or "a drive's name" in runs["worst"].stderr
    assert runs["worst"].stderr.count("\n") == 1
    assert "Traceback" not in said


def test_a_drives_name_in_the_tables_alone_is_no_path(fleet):
    called(fleet, "../../mine/x", summary=False)
    runs, _, _ = looked_into(fleet)
    assert "a drive is called '../../mine/x', which is not a name" in runs["worst"].stderr
    assert {run.returncode for run in runs.values()} == {1}


@pytest.mark.parametrize("link", ["recordings", "recordings/{}.rrd", "recordings/.{}.rrd.lock"])
def test_nothing_is_written_through_a_link(fleet, link):
    place = fleet / link.format(first(fleet))
    place.parent.mkdir(exist_ok=True)
    target = {"recordings": "", ".lock": "kept.txt"}.get(place.suffix or place.name, "new.rrd")
    place.symlink_to(fleet.parent / "mine" / target)
    runs, _, _ = looked_into(fleet)
    assert runs["worst"].returncode == 1
    assert runs["worst"].stderr.count("error: ") == 1


@pytest.mark.parametrize("link", ["recordings/{}.rrd", "results/{}"])
def test_what_a_link_leads_to_is_not_read(fleet, link):
    place = fleet / link.format(first(fleet))
    place.parent.mkdir(exist_ok=True)
    if place.exists():
        place.rename("kept")
    place.symlink_to(fleet.parent / "kept")
    refused = here("inspect", fleet, "--worst", 1, "--screenshot", "a.png")
    assert refused.returncode == 1
    assert "leads out of the fleet's folder; remove it" in refused.stderr


def test_a_report_is_not_written_through_a_link(fleet):
    (fleet / "report.pdf").symlink_to(fleet.parent / "mine" / "kept.txt")
    runs, _, _ = looked_into(fleet)
    assert runs["report"].returncode == 1
    assert "a link leads out of the folder" in runs["report"].stderr


@pytest.mark.parametrize("name", ["worst.parquet", "run.toml", "results"])
def test_the_fleets_own_command_writes_through_no_link(fleet, made, name):
    if (fleet / name).is_dir():
        shutil.rmtree(fleet / name)
    else:
        (fleet / name).unlink()
    (fleet / name).symlink_to(fleet.parent / "mine" / ("" if name == "results" else "kept.txt"))
    before = outside(fleet)
    done = here("fleet", made.parent / "logs", "-o", fleet, "--train-frames", 4)
    assert done.returncode == 1
    assert "a link leads out of the fleet's folder" in done.stderr
    assert outside(fleet) == before


def test_a_claim_overwrites_nothing_that_a_link_leads_to(tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / ".out.lock").symlink_to(tmp_path / "mine")
    with pytest.raises(OSError, match="symbolic"), claim(tmp_path / "out", tmp_path):
        pytest.fail("it is claimed")
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.fixture
def server():
    with Server() as server:
        yield server


def test_a_drives_url_is_not_asked(fleet, server):
    url = server.url("whole/a.mcap?sig=geheim", user="me:geheim@")
    change(fleet, "source", url)
    runs, said, _ = looked_into(fleet)
    assert server.requests == []
    assert runs["worst"].returncode == 1
    assert f"make it with: roadeval replay {server.url('whole/a.mcap')} " in runs["worst"].stderr
    assert PASSWORD not in said


@pytest.mark.parametrize(
    "source",
    [
        "http://me:geheim@127.0.0.1:9/a.mcap",
        " http:/me:geheim@127.0.0.1:9/a.mcap",
        "https://127.0.0.1:9/a.mcap?X-Amz-Signature=geheim",
    ],
)
def test_a_password_is_told_nowhere(fleet, source):
    change(fleet, "source", source)
    change(fleet, "reason", f"{source}: it failed")
    _, said, _ = looked_into(fleet)
    assert PASSWORD not in said
    assert "Traceback" not in said
    for path in (fleet / "page.html", fleet / "report.pdf"):
        if path.exists():
            assert PASSWORD.encode() not in path.read_bytes()


@pytest.mark.parametrize("word", ["http://me:geheim@127.0.0.1:9/a.mcap", "no://me:geheim@host/a"])
def test_a_password_on_the_command_line_is_told_nowhere(
    tmp_path, word, monkeypatch, without_workers
):
    monkeypatch.setitem(remote.RETRIES, "max_retries", 0)
    manifest = tmp_path / "drives.toml"
    manifest.write_text(f'[[drives]]\npath = "{word}"\nlabels = {{ road = [3] }}\n')
    folder = tmp_path / "f"
    for words in (
        ("replay", word),
        ("info", word),
        ("report", word),
        ("fleet", word, "-o", folder),
        ("fleet", manifest, "-o", folder),
    ):
        done = here(*words, cwd=tmp_path)
        assert done.returncode in (1, 3)
        assert PASSWORD not in done.stdout + done.stderr
    for path in folder.rglob("*") if folder.exists() else ():
        assert path.is_dir() or PASSWORD.encode() not in path.read_bytes()


def test_masks_and_networks_of_its_configuration_are_not_read(fleet):
    run = fleet / "results" / first(fleet) / "run.toml"
    (fleet.parent / "mine" / "net.onnx").write_bytes(b"not for them")
    mine = fleet.parent / "mine"
    run.write_text(
        f'{run.read_text()}\n[masks.theirs]\npath = "{mine}"\n[variants.net]\n'
        f'chain = ["net", "post"]\n[variants.net.net]\nfile = "{mine / "net.onnx"}"\n'
    )
    *_, seen = looked_into(fleet)
    assert ("read", str(mine / "net.onnx")) not in seen
