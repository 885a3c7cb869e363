"""Results at URLs, which are fetched whole and opened as those that lie here."""

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import pytest

import roadeval
from roadeval import RoadevalError
from roadeval.fleet import remote
from tests.fleet.serving import Server, s3_is_at
from tests.jobs.making import settings, write_log
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a recording, its results, and zips of these and of a fleet."""
    there = tmp_path_factory.mktemp("there")
    log = write_log(there / "street.mcap")
    config = settings(max_frames=14, record="masks")
    roadeval.replay(log, config, save=there / "street.rrd", reports=there / "street")
    fleet_of(there / "below" / "week", 3)
    shutil.make_archive(str(there / "run"), "zip", there / "street")
    shutil.make_archive(str(there / "week"), "zip", there / "below")
    with ZipFile(there / "one.zip", "w") as archive:
        archive.write(there / "street.rrd", "recordings/street.rrd")
    return there


@pytest.fixture(scope="module")
def server(folder):
    with Server(folder) as running:
        yield running


def refused(url):
    """The message with which the result at a URL is refused."""
    with pytest.raises(RoadevalError) as error:
        roadeval.Result(url)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_recording_and_zips_of_a_result_open_as_if_they_lay_here(folder, server):
    here = roadeval.Result(folder / "street.rrd").scores
    for name in ("street.rrd", "run.zip", "one.zip"):
        result = roadeval.Result(server.url(f"nightly/{name}"))
        assert result.scores.equals(here)
        assert (result.recording is None) == (name == "run.zip")
    assert roadeval.Result(server.url("week.zip")).fleet.name == "week"
    there = roadeval.Result(folder / "below" / "week").drives
    assert roadeval.Result(server.url("week.zip")).drives.equals(there)


def test_it_is_fetched_once_compared_and_reported_under_its_own_name(
    folder, server, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    url, public = server.url("base/run.zip", user="me:geheim@"), server.url("base/run.zip")
    compared = roadeval.compare([url, folder / "street.rrd"])
    fetched = len(server.requests)
    assert [side.label for side in compared.comparison.results] == ["run", "street"]
    assert roadeval.write_report(url) == Path("reports", "run.pdf")
    assert len(server.requests) == fetched
    inspected = roadeval.Result(server.url("street.rrd")).drive.inspect(3)
    assert inspected == f"roadeval inspect {server.url('street.rrd')} --frame 3"
    assert public.startswith("http://127")


def test_an_object_in_a_bucket_is_a_result(folder, server, monkeypatch):
    s3_is_at(server.url(""), monkeypatch)
    assert roadeval.Result("s3://bucket/nightly/run.zip").drive.name == "street"


def test_what_is_no_result_is_told_in_one_line_with_the_url_and_no_secret(folder, server):
    (folder / "login.zip").write_text("<html>Log in</html>")
    with ZipFile(folder / "two.zip", "w") as archive:
        for name in ("a", "b"):
            archive.write(folder / "street" / "summary.json", f"{name}/summary.json")
    with ZipFile(folder / "empty.zip", "w") as archive:
        archive.writestr("read.me", "")
    for name, problem in {
        "street/": "a folder is not fetched; name a recording, or a zip",
        "login.zip": "login.zip: not a recording",
        "two.zip": "cannot be used: it holds 2 results",
        "empty.zip": "cannot be used: it holds no results",
    }.items():
        message = refused(server.url(name, user="me:geheim@"))
        assert message.startswith(server.url(name))
        assert problem in message
        assert "geheim" not in message


def test_names_in_a_zip_lead_nowhere_else_and_links_are_not_followed(folder, server):
    secret = folder / "secret"
    secret.write_text("geheim")
    with ZipFile(folder / "evil.zip", "w") as archive:
        for path in sorted((folder / "street").iterdir()):
            archive.write(path, path.name)
        archive.writestr("../../../escaped", "")
        archive.writestr(str(folder / "absolute"), "")
        link = ZipInfo("link")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, str(secret))
    (path,) = roadeval.Result(server.url("evil.zip")).paths
    assert not (folder / "absolute").exists()
    unpacked = Path(remote._home().name)
    assert all(part.is_relative_to(path) for part in unpacked.rglob("escaped"))
    assert (path / "link").read_text() == str(secret)
    assert not (path / "link").is_symlink()


def bomb(path, size, stated=None):
    """Write a zip with a file of ``size`` bytes, which states another size."""
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr("summary.json", bytes(size))
    content = path.read_bytes()
    if stated is not None:
        path.write_bytes(content.replace(struct.pack("<L", size), struct.pack("<L", stated)))


def test_what_is_too_large_is_refused_by_what_it_states_and_by_what_it_is(
    folder, server, monkeypatch
):
    monkeypatch.setattr(remote, "ROOM", 100_000)
    bomb(folder / "large.zip", 200_000)
    assert "cannot be used: larger than" in refused(server.url("large.zip"))
    bomb(folder / "lying.zip", 200_000, stated=10)
    assert "cannot be used: Bad CRC-32" in refused(server.url("lying.zip"))
    sizes = [path.stat().st_size for path in Path(remote._home().name).rglob("summary.json")]
    assert 200_000 not in sizes
    with ZipFile(folder / "many.zip", "w") as archive:
        for number in range(30):
            archive.writestr(f"{number}", "")
    assert "larger than" in refused(server.url("many.zip"))
    before = server.sent
    (folder / "long.rrd").write_bytes(bytes(100_001))
    assert "larger than" in refused(server.url("long.rrd"))
    assert server.sent == before


def test_nothing_is_left_when_the_process_ends(folder, server, tmp_path):
    code = f"import roadeval; print(roadeval.Result({server.url('run.zip')!r}).paths[0])"
    words = [sys.executable, "-c", code]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(words, env=environment, check=True, capture_output=True, text=True)
    assert done.stdout.startswith(str(tmp_path))
    assert not list(tmp_path.iterdir())
