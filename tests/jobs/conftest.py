"""Small replays draw no figures."""

from tests.fixtures.figures import without_figures  # noqa: F401
