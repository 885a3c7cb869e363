"""The report of a fleet: what it says, and how it grows."""

import shutil
from dataclasses import replace

import pytest

from roadeval.jobs.results.report import write_report
from roadeval.jobs.results.result import Result
from roadeval.report.blocks import Figure, ImageGrid, Table, Text
from roadeval.report.sections import drive, drives, summary
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import FAILED
from tests.report.making import opened, plain_rows, text, the
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Twelve drives: one failed, one is without truth, one has lost a part."""
    return fleet_of(tmp_path_factory.mktemp("fleet") / "street", 12, pictures=12)


@pytest.fixture(scope="module")
def findings(folder):
    return FleetFolder(folder)


def blocks(section, findings):
    return opened(section(findings))


def tables(section, findings):
    return [block for block in blocks(section, findings) if isinstance(block, Table)]


def test_the_first_page_has_the_verdict_the_rates_and_the_differences(findings):
    told = blocks(summary.section, findings)
    assert findings.facts.verdict in [b.text for b in told if isinstance(b, Text)]
    rates, effects = tables(summary.section, findings)
    assert [row[0] for row in plain_rows(rates)] == ["filtered", "unfiltered", "blind"]
    first, *others = (own["post"] for own in findings.facts.totals.values())
    assert plain_rows(rates)[0][1:4] == ["10", "200", f"{100 * first['ERR']:.2f}"]
    bold = [cell.text for row in rates.rows for cell in row[3:4] if cell.bold]
    assert bold == [f"{100 * min(r['ERR'] for r in (first, *others)):.2f}"]
    assert plain_rows(effects)[0][0] == "filtered \N{MINUS SIGN} unfiltered"
    assert len(effects.rows) == 3
    assert effects.groups[-1] == ("drives", 2)


def test_the_regions_of_all_drives_are_drawn(findings):
    (figure,) = (each for each in blocks(drive.regions, findings) if isinstance(each, Figure))
    final = Result(findings.path).scores.query("final and region != 'all'")
    sums = final.groupby(["variant", "region"])[["FP", "FN", "N"]].sum()
    assert len(figure.charts[0].names) == findings.regions.index.unique("region").size > 0
    for (region, variant), own in findings.regions.iterrows():
        counted = sums.loc[(variant, region)]
        assert own["ERR"] == pytest.approx((counted.FP + counted.FN) / counted.N)


def test_the_worst_frames_have_pictures_and_missing_ones_are_named(folder, findings, tmp_path):
    grid = the(ImageGrid, [b for b in blocks(drives.worst, findings) if isinstance(b, ImageGrid)])
    assert len(grid.pictures) == 12
    first = findings.worst.iloc[0]
    name = f"{findings.names[first['drive']]}, frame {first['frame']}"
    assert grid.pictures[0][0].startswith(f"1. {name}")
    copy = shutil.copytree(folder, tmp_path / "copy")
    picture = copy / "pictures" / first["drive"] / f"{first['frame']}.jpg"
    picture.write_bytes(picture.read_bytes()[:50])
    told = blocks(drives.worst, (FleetFolder(copy)))
    assert len(told[1].pictures) == 11
    assert "Not in the folder: 1 picture." in told[2].text


def test_a_report_lands_in_the_fleets_folder_and_is_the_same_each_time(folder):
    path = write_report(folder)
    assert path == folder / "report.pdf"
    first = path.read_bytes()
    assert "What the filter changes" in text(first)
    assert write_report(folder).read_bytes() == first


def test_a_fleet_in_which_every_drive_failed_has_a_report(tmp_path):
    fleet = fleet_of(tmp_path / "f", 2, status=lambda _: FAILED)
    told = text(write_report(fleet).read_bytes())
    assert "Drives that failed: 2" in told
    assert "Nothing to score: no frame with truth was evaluated." in told


def test_two_drives_of_one_name_are_told_apart(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "copy")
    found = FleetFolder(copy)
    drives_ = [replace(each, name="same") for each in found.facts.drives]
    assert len({each.drive for each in drives_}) == 12
    (copy / "fleet.json").write_text(replace(found.facts, drives=drives_).text())
    names = (FleetFolder(copy)).names
    assert len(set(names.values())) == 12
