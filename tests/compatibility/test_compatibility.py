"""Results of earlier versions are refused in one line that says who wrote them."""

import pytest

import roadeval
from tests.compatibility.make import MODEL, RECORDING, RESULTS, unpack, versions
from tests.e2e.commands import here


@pytest.fixture(scope="module", params=versions())
def made(request, tmp_path_factory):
    return request.param, unpack(request.param, tmp_path_factory.mktemp(request.param))


@pytest.mark.parametrize("command", ["report", "compare", "inspect --list"])
@pytest.mark.parametrize("name", [RECORDING, RESULTS])
def test_its_version_is_named_and_the_way_out(made, name, command):
    version, folder = made
    run = here(*command.split(), folder / name)
    told = f"made by roadeval {version} in a format that is no longer read: replay the log again\n"
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith(f"roadeval: error: {folder / name}")
    assert run.stderr.endswith(told)
    assert run.stderr.count("\n") == 1


def test_the_version_that_wrote_a_model_is_named(made):
    version, folder = made
    told = f"made by roadeval {version} in a format that is no longer read: train it again"
    with pytest.raises(roadeval.RoadevalError, match=told):
        roadeval.load_model(folder / MODEL)
