"""The names of the package, each imported when it is first used."""

import pytest

import roadeval


@pytest.mark.parametrize("name", roadeval.__all__)
def test_every_public_name_is_there(name):
    assert getattr(roadeval, name) is not None


def test_no_other_name_is_there():
    with pytest.raises(AttributeError, match="module 'roadeval' has no attribute 'nothing'"):
        roadeval.nothing  # noqa: B018
