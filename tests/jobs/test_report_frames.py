"""The frames that pages picture: with every variant's layers, as far as there is room."""

import pytest

import roadeval
from roadeval.jobs.results.report import page_of
from roadeval.jobs.results.result import Result
from roadeval.report.findings import Findings
from roadeval.report.sections.frames import FrameBrowser
from roadeval.results.rows import as_arrays
from tests.evaluation.making import a_table, rows_of
from tests.jobs.making import settings, write_log
from tests.report.making import some_findings

OTHERS = {name: {"chain": ["similarity", "post"]} for name in ("third", "fourth")}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A short drive replayed with four variants."""
    folder = tmp_path_factory.mktemp("four")
    log = write_log(folder / "drive.mcap")
    path = folder / "out.rrd"
    config = settings(train_frames=4, variants=OTHERS)
    roadeval.replay(log, config, save=path, reports=folder / "reports")
    return path


def browser(document):
    (found,) = (block for block in document.blocks if isinstance(block, FrameBrowser))
    return found


def layered(strip):
    """The variants whose layers a strip shows."""
    return [row[0].name.partition(":")[0] for row in strip.rows[1:]]


def test_every_variants_errors_and_layers_are_shown(recording):
    shown = browser(page_of(Result(recording)))
    for strip in shown.strips:
        assert layered(strip) == ["filtered", "unfiltered", "third", "fourth"]
        names = [picture.name for picture in strip.rows[0]]
        assert names[2:] == [f"{each}: errors" for each in layered(strip)]


# --- What a report of a long drive shows of its windows -------------------------------------------


def findings(**tables):
    """Findings of a drive of some tables."""

    def table(name):
        return rows_of(tables[name]) if name in tables else as_arrays(name, ())

    return Findings("drive.rrd", some_findings().facts, table)


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    windows = findings(frames=a_table({("filtered", "post"): [10] * frames})).windows
    assert set(windows["frames"][:-1]) == {size}
    assert len(windows) == rows
    assert windows["frames"].sum() == frames
