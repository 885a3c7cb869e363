"""Drives in a bucket: on the S3 server of moto, at 127.0.0.1."""

import os
from importlib.util import find_spec
from urllib.request import Request, urlopen

import pytest

from roadeval.errors import RoadevalError
from roadeval.fleet import find_drives, readable, stamp
from roadeval.logs import open_log
from tests.fixtures.elsewhere import split_bag, talker

if not all(map(find_spec, ("moto", "flask"))):
    pytest.skip("moto[s3] and flask are not installed", allow_module_level=True)

LOG = talker(3).bytes()
LONG = os.urandom(11 << 20)
OBJECTS = {
    "top.mcap": LOG,
    "d/drive_10.mcap": LOG,
    "d/drive_2.mcap": LONG,
    "d/a b%20+#?.mcap": LOG,
    "d/.hidden/a.mcap": LOG,
    "d/x.5d1c02fe.partial.mcap": LOG,
    "d/note.txt": b"note",
    "d/more/metadata.yaml": b"title: something else",
    "d/more/one.mcap": LOG,
    **{f"d/run/{name}": content for name, content in split_bag().items()},
    "empty/note.txt": b"note",
}


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
    for key in [key for key in os.environ if key.startswith("AWS_")]:
        monkeypatch.delenv(key)
    for key, value in {
        "AWS_ACCESS_KEY_ID": "user",
        "AWS_SECRET_ACCESS_KEY": "geheim",
        "AWS_ENDPOINT_URL": bucket,
        "AWS_ALLOW_HTTP": "true",
    }.items():
        monkeypatch.setenv(key, value)


@pytest.fixture
def filled(s3):
    import obstore
    from obstore.store import S3Store

    store = S3Store("bucket", client_options={"allow_http": "true"})
    urlopen(Request(f"{os.environ['AWS_ENDPOINT_URL']}/one-bag", method="PUT"), timeout=60).close()
    for name, content in split_bag().items():
        obstore.put(S3Store("one-bag", client_options={"allow_http": "true"}), name, content)
    for key, content in OBJECTS.items():
        obstore.put(store, key, content)


def test_a_bucket_and_a_folder_are_listed_in_natural_order(filled):
    below = [
        "s3://bucket/d/a b%20+#?.mcap",
        "s3://bucket/d/drive_2.mcap",
        "s3://bucket/d/drive_10.mcap",
        "s3://bucket/d/more/one.mcap",
        "s3://bucket/d/run/",
    ]
    assert [entry.source for entry in find_drives(["s3://bucket/d/"])] == below
    everything = find_drives(["s3://bucket/", "s3://bucket/top.mcap"])
    assert [entry.source for entry in everything] == [*below, "s3://bucket/top.mcap"]
    assert [entry.source for entry in find_drives(["s3://bucket/d/run/"])] == below[-1:]
    assert [entry.name for entry in everything][-2:] == ["run", "top"]


def test_a_bucket_that_is_a_bag_is_one_drive(filled):
    (entry,) = find_drives(["s3://one-bag/"])
    assert (entry.source, entry.name) == ("s3://one-bag/", "one-bag")
    assert len(readable(entry.source).files) == 3


def test_a_stamp_tells_whether_an_object_has_changed(filled, s3):
    import obstore
    from obstore.store import S3Store

    before = stamp("s3://bucket/top.mcap")
    assert before == stamp("s3://bucket/top.mcap")
    assert before["top.mcap"][0] == len(LOG)
    store = S3Store("bucket", client_options={"allow_http": "true"})
    obstore.put(store, "top.mcap", LOG[:-1] + b"x")
    assert stamp("s3://bucket/top.mcap")["top.mcap"][1] != before["top.mcap"][1]
    assert list(stamp("s3://bucket/d/run/")) == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("s3://bucket/empty/", "s3://bucket/empty/: no log there or below"),
        ("s3://bucket/gone/", "s3://bucket/gone/: no log there or below"),
        ("s3://no-such-bucket/", "s3://no-such-bucket/: there is no such"),
    ],
)
def test_a_folder_without_drives_is_an_error(filled, word, message):
    with pytest.raises(RoadevalError, match=message) as error:
        find_drives([word])
    assert "\n" not in str(error.value)


def test_a_bucket_that_denies_access_is_an_error(filled, monkeypatch):
    monkeypatch.setenv("AWS_SKIP_SIGNATURE", "true")
    url = "s3://bucket/top.mcap"
    with pytest.raises(RoadevalError, match="the server denies access"):
        readable(url)


def test_a_log_in_a_bucket_is_read_by_its_parts(filled, tmp_path):
    (tmp_path / "top.mcap").write_bytes(LOG)
    with (
        open_log(tmp_path / "top.mcap") as disk,
        open_log(readable("s3://bucket/top.mcap")) as log,
        open_log(readable("s3://bucket/d/run/")) as bag,
    ):
        assert log.digest == disk.digest
        assert log.topics == disk.topics
        assert (log.name, bag.name) == ("top", "run")
        assert sum(topic.count for topic in bag.topics) > 0
