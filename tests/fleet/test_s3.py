"""Drives in a bucket: on the S3 server of moto, at 127.0.0.1."""

from importlib.util import find_spec
from urllib.request import Request, urlopen

import pytest

from roadeval.errors import RoadevalError
from roadeval.fleet.drives import find_drives
from roadeval.fleet.remote import open_source, stamp
from roadeval.logs.log import open_log
from tests.fixtures.elsewhere import talker
from tests.fleet.serving import s3_is_at

if not all(map(find_spec, ("moto", "flask"))):
    pytest.skip("moto[s3] and flask are not installed", allow_module_level=True)

LOG = talker(3).bytes()
OBJECTS = {"top.mcap": LOG, "d/a b%20+#?.mcap": LOG}


@pytest.fixture(scope="module")
def bucket():
    """A server's address, with a bucket of drives."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    url = "http://{}:{}".format(*server.get_host_and_port())
    urlopen(Request(f"{url}/bucket", method="PUT"), timeout=60).close()
    yield url
    server.stop()


@pytest.fixture
def s3(bucket, monkeypatch):
    s3_is_at(bucket, monkeypatch)


@pytest.fixture
def filled(s3):
    import obstore
    from obstore.store import S3Store

    store = S3Store("bucket", client_options={"allow_http": "true"})
    for key, content in OBJECTS.items():
        obstore.put(store, key, content)


def test_a_key_means_itself_letter_by_letter(filled):
    url = "s3://bucket/d/a b%20+#?.mcap"
    assert [entry.source for entry in find_drives([url])] == [url]
    assert stamp(url)[0] == len(LOG)


@pytest.mark.parametrize("url", ["s3://bucket/d/", "https://host/d/"])
def test_a_folder_is_refused_in_one_line(url):
    with pytest.raises(RoadevalError, match=f"{url}: a folder; name its logs, or a manifest"):
        find_drives([url])


def test_a_stamp_tells_whether_an_object_has_changed(filled, s3):
    import obstore
    from obstore.store import S3Store

    before = stamp("s3://bucket/top.mcap")
    assert before == stamp("s3://bucket/top.mcap")
    assert before[0] == len(LOG)
    store = S3Store("bucket", client_options={"allow_http": "true"})
    obstore.put(store, "top.mcap", LOG[:-1] + b"x")
    assert stamp("s3://bucket/top.mcap")[1] != before[1]


def test_a_log_in_a_bucket_is_read_by_its_parts(filled, tmp_path):
    (tmp_path / "top.mcap").write_bytes(LOG)
    with (
        open_log(tmp_path / "top.mcap") as disk,
        open_log(open_source("s3://bucket/top.mcap")) as log,
    ):
        assert log.digest == disk.digest
        assert log.topics == disk.topics
        assert log.name == "top"
