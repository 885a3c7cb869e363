"""``roadeval report``: a page in a real browser, and a PDF that says what the tables say."""

import io
import json
import re
import shutil
import signal
import socket
import subprocess
import sys

import cv2
import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader

from roadeval.jobs.results import frames
from roadeval.jobs.results.result import DriveResult
from roadeval.logs.writing.writer import LogWriter
from tests.e2e.commands import here, roadeval
from tests.fixtures.browser import missing, violations, wait_until
from tests.results.fleet.making import fleet_of

if reason := missing():
    pytest.skip(reason, allow_module_level=True)


@pytest.fixture(scope="module")
def drive(demo, tmp_path_factory):
    """The page of the demo, made where nothing else is at hand."""
    folder = tmp_path_factory.mktemp("page")
    shutil.copy(demo.recording, folder / "drive.rrd")
    run = here("report", "drive.rrd", "-o", "page.html", cwd=folder)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "page.html\n"
    return folder / "page.html"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """The page of a fleet whose drives have pictures."""
    folder = fleet_of(tmp_path_factory.mktemp("fleet") / "week", 24, pictures=24)
    path = folder.with_name("index.html")
    run = here("report", folder, "-o", path)
    assert run.returncode == 0, run.stderr
    return path


@pytest.fixture
def tab(drive, watched):
    """The page of the demo in a tab."""
    return watched(drive.as_uri()).tab


def shown(tab, selector):
    """The texts of what is seen."""
    return [each.text_content() for each in tab.locator(selector).all() if each.is_visible()]


def frame(tab):
    """The number of the frame that is looked at."""
    return int(re.match(r"Frame (\d+)", tab.locator(".where").inner_text())[1])


# --- A page of one drive --------------------------------------------------------------------------


def test_a_page_is_one_file_of_at_most_10_mb_and_asks_for_nothing(drive, watched):
    assert drive.stat().st_size < 10_000_000
    assert {each.name for each in drive.parent.iterdir()} == {"page.html", "drive.rrd"}
    seen = watched(drive.as_uri())
    assert seen.elsewhere == []
    assert [url for url in seen.requests if url.startswith("file:")] == [drive.as_uri()]
    assert seen.complaints == []


def test_every_evaluated_frame_is_in_the_table_with_its_rates(tab, demo):
    rows = tab.locator(".frames tbody tr")
    assert rows.count() == demo.summary["frames"]["evaluated"]
    columns = tab.locator(".frames thead th[data-rate=ERR]").all_inner_texts()
    assert [each.strip() for each in columns] == ["filtered", "unfiltered", "blind"]
    values = rows.evaluate_all("rows => rows.map(row => Number(row.cells[2].textContent))")
    mean = demo.summary["totals"]["filtered"]["post"]["ERR"]
    assert sum(values) / len(values) == pytest.approx(100 * mean, abs=0.01)


def test_a_click_on_a_title_sorts_and_another_one_turns_it_round(tab):
    title = tab.locator(".frames thead th[data-rate=ERR] button").first
    read = "rows => rows.map(row => Number(row.cells[2].textContent))"
    title.click()
    values = tab.locator(".frames tbody tr").evaluate_all(read)
    assert values == sorted(values, reverse=True)
    title.press("Enter")
    assert tab.locator(".frames tbody tr").evaluate_all(read) == sorted(values)
    assert tab.locator(".frames th[aria-sort]").get_attribute("aria-sort") == "ascending"


def test_frames_are_filtered_by_variant_rate_and_condition(tab):
    everything = tab.locator(".frames tbody tr").count()
    tab.locator(".choice select").first.select_option("unfiltered")
    assert shown(tab, ".frames thead th[data-variant]") == ["unfiltered"] * 3
    tab.fill("[name=least]", "20")
    rates = [float(text) for text in shown(tab, ".frames tbody td:nth-child(4)")]
    assert 0 < len(rates) < everything
    assert min(rates) >= 20
    tab.click(".filters [type=reset]")
    tab.locator(".choice select").first.select_option("")
    wait_until(tab, "document.querySelectorAll('.frames tr[hidden]').length === 0")
    tab.select_option("[name=condition]", label="the filter helps")
    notes = shown(tab, ".frames tbody td:last-child")
    assert 0 < len(notes) < everything
    assert all("the filter helps" in note for note in notes)
    errors = (shown(tab, f".frames tbody td:nth-child({column})") for column in (3, 4))
    assert all(float(with_) < float(without) for with_, without in zip(*errors, strict=True))


def test_the_worst_frame_is_seen_first_and_arrow_keys_go_from_frame_to_frame(tab):
    errors = tab.locator(".frames tr.pictured").evaluate_all(
        "rows => rows.map(row => [Number(row.cells[2].textContent), Number(row.dataset.frame)])"
    )
    first = frame(tab)
    assert first == max(errors)[1]
    tab.keyboard.press("ArrowRight")
    after = frame(tab)
    assert after > first
    tab.keyboard.press("ArrowLeft")
    assert frame(tab) == first
    assert len(shown(tab, ".strip .two")) == 1
    assert tab.locator(".frames tr[aria-current]").get_attribute("data-frame") == str(first)


def test_the_link_below_the_verdict_leads_to_the_worst_frame(tab, demo):
    tab.keyboard.press("ArrowRight")
    link = tab.locator("#summary .links a")
    link.click()
    rows = pd.read_csv(demo.reports / "frames.csv").query(
        "variant == 'filtered' and stage == 'post'"
    )
    worst = int(rows.loc[rows["ERR"].idxmax(), "frame"])
    assert frame(tab) == worst
    assert tab.locator(".strip:visible").get_attribute("data-frame") == str(worst)
    command = tab.locator("#summary .links code").inner_text()
    assert command == f"roadeval inspect drive.rrd --frame {worst}"


def test_a_frame_without_pictures_offers_the_nearest_and_its_note(tab):
    rows = tab.locator(".frames tbody tr")
    has = {int(row.get_attribute("data-frame")): row for row in rows.all()}
    pictured = {number for number, row in has.items() if row.get_attribute("class") == "pictured"}
    lacking = [number for number in has if number not in pictured]
    number = max(lacking, key=lambda each: min(abs(each - other) for other in pictured))
    has[number].click()
    assert tab.locator(".stage").is_hidden()
    note = has[number].get_attribute("data-note")
    assert note is None or note in tab.locator(".absent").inner_text()
    tab.locator(".absent button").click()
    distance = min(abs(number - other) for other in pictured)
    assert abs(frame(tab) - number) == distance
    assert tab.locator(".stage").is_visible()


def test_the_address_names_the_frame_and_back_goes_to_the_last_one(tab, drive, watched):
    first = frame(tab)
    assert "#" not in tab.url
    one, two = (
        int(each.get_attribute("data-frame")) for each in tab.locator("tr.pictured").all()[1:3]
    )
    for number in (one, two):
        tab.locator(f".frames tr[data-frame='{number}'] a").click()
        assert tab.url.endswith(f"#frame-{number}")
    tab.keyboard.press("ArrowRight")
    assert tab.url.endswith(f"#frame-{frame(tab)}")
    assert frame(tab) > two
    tab.go_back()
    assert frame(tab) == one
    tab.go_back()
    assert frame(tab) == first
    assert frame(watched(f"{drive.as_uri()}#frame-{two}").tab) == two


def test_a_slider_lies_between_two_variants(tab):
    assert tab.locator("select.left").input_value() == "filtered: errors"
    assert tab.locator("select.right").input_value() == "unfiltered: errors"
    above, below = (tab.locator(f".views .{name}") for name in ("above", "below"))
    assert above.get_attribute("src") != below.get_attribute("src")
    above.scroll_into_view_if_needed()
    box = above.bounding_box()
    tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + 50)
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] / 4, box["y"] + 50, steps=4)
    tab.mouse.up()
    assert float(tab.locator(".names input").input_value()) == pytest.approx(25, abs=1)
    assert above.evaluate("each => each.style.clipPath").startswith("inset(0")
    tab.select_option("select.right", "camera")
    tab.keyboard.press("Escape")
    assert "camera" in below.get_attribute("alt")
    tab.locator(".where").click()
    tab.keyboard.press("ArrowRight")
    assert tab.locator("select.right").input_value() == "camera"


def test_a_picture_enlarges_and_arrow_keys_go_on_inside(tab):
    first = frame(tab)
    tab.locator(".strip:not([hidden]) .tile img").nth(1).click()
    assert tab.locator("dialog .views").is_visible()
    assert tab.locator("dialog select.left").input_value() == "truth"
    tab.keyboard.press("ArrowRight")
    assert frame(tab) > first
    tab.keyboard.press("Escape")
    tab.locator("dialog .views").wait_for(state="detached")
    assert tab.locator(".viewer .views").is_visible()


def test_a_click_on_a_chart_shows_its_frame_and_the_pointer_its_values(tab):
    for chart in (tab.locator(".browser .area").first, tab.locator("figure .along .area").last):
        chart.scroll_into_view_if_needed()
        box = chart.bounding_box()
        tab.mouse.move(box["x"] + box["width"] * 0.4, box["y"] + box["height"] / 2)
        tip = tab.locator(".tip:visible")
        number = int(re.match(r"frame (\d+)", tip.inner_text())[1])
        tab.mouse.down()
        tab.mouse.up()
        row = tab.locator(f".frames tr[data-frame='{number}']")
        assert frame(tab) == number
        assert row.get_attribute("aria-current") == "true"
    assert tab.locator(".absent").is_visible() or tab.locator(".stage").is_visible()


def test_a_part_of_the_drive_is_the_same_part_in_every_chart_and_in_the_table(tab):
    everything = tab.locator(".frames tbody tr").count()
    chart = tab.locator(".browser .area").first
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    tab.mouse.move(box["x"] + box["width"] * 0.2, box["y"] + 20)
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + 20, steps=5)
    tab.mouse.up()
    views = tab.locator(".along .area").evaluate_all(
        "all => all.map(a => a.getAttribute('viewBox'))"
    )
    assert len(views) > 4
    assert len(set(views)) == 1
    left, _, width, _ = map(float, views[0].split())
    told = tab.locator(".browser .along").first.get_attribute("data-values")
    first, last = json.loads(told)["x"]
    low, size = (share * (last - first) / 100 for share in (left, width))
    low += first
    numbers = [
        int(each.get_attribute("data-frame"))
        for each in tab.locator(".frames tbody tr:not([hidden])").all()
    ]
    assert 0 < len(numbers) < everything
    assert low <= min(numbers) <= max(numbers) <= low + size
    tab.locator(".whole:visible").first.click()
    assert tab.locator(".frames tbody tr:not([hidden])").count() == everything


def test_two_variants_are_chosen_for_the_whole_page(tab):
    one, other = tab.locator(".choice select").all()
    assert other.is_disabled()
    one.select_option("unfiltered")
    other.select_option("blind")
    assert set(shown(tab, ".legend li")) & {"filtered", "unfiltered", "blind"} == {
        *("unfiltered", "blind")
    }
    assert not [each for each in tab.locator("g[data-of=filtered]").all() if each.is_visible()]
    assert shown(tab, "#summary tbody th") == ["unfiltered", "blind"]
    assert tab.locator("select.left").input_value() == "unfiltered: errors"
    tab.locator(".rows").first.locator(".row").nth(2).hover()
    assert "\nfiltered" not in tab.locator(".tip:visible").inner_text()
    one.select_option("")
    assert shown(tab, "#summary tbody th") == ["filtered", "unfiltered", "blind"]


@pytest.mark.parametrize(("width", "scheme"), [(1440, "light"), (390, "dark")])
def test_light_and_dark_wide_and_narrow_nothing_runs_over_and_axe_is_content(
    drive, fleet, scheme, width, watched
):
    for path in (drive, fleet):
        seen = watched(path.as_uri(), width=width, color_scheme=scheme)
        paper = seen.tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
        assert seen.tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert violations(seen.tab) == []
        assert seen.complaints == []


def test_without_a_script_everything_is_there(drive, watched):
    tab = watched(drive.as_uri(), java_script_enabled=False).tab
    assert len(shown(tab, ".strip h3")) > 5
    outcomes = tab.locator(".strip > .pictures img")
    assert all(each.is_visible() for each in outcomes.all()[:20])
    tab.locator(".strip summary").first.click()
    assert tab.locator(".strip").first.locator("img").last.is_visible()
    assert shown(tab, ".charts .axis")
    assert not shown(tab, ".filters, .tools, .stage, .find, .scripted")


# --- Fleets, folders, what is wrong usage ---------------------------------------------------------


def test_a_fleets_page_has_every_drive_and_finds_one(fleet, watched):
    seen = watched(fleet.as_uri())
    told = json.loads((fleet.parent / "week" / "fleet.json").read_text())
    rows = seen.tab.locator("#all-drives tbody tr")
    assert rows.count() == len(told["drives"]) == 24
    seen.tab.fill("#all-drives input", "drive_0003")
    assert len(shown(seen.tab, "#all-drives tbody tr")) == 1
    link = seen.tab.locator("#summary .links a")
    assert re.fullmatch(r"Worst frame: \w+, frame \d+ \(ERR \d+\.\d %\)", link.inner_text())
    place = seen.tab.locator(link.get_attribute("href"))
    assert place.locator("h2").inner_text() == "The worst frames over all drives"
    pictures = seen.tab.locator(".grid img")
    assert pictures.count() > 5
    pictures.first.scroll_into_view_if_needed()
    wait_until(seen.tab, "document.querySelector('.grid img').naturalWidth > 0")
    assert all(url.startswith((fleet.as_uri(), "data:")) for url in seen.requests)
    assert seen.complaints == []


def test_without_truth_a_page_shows_the_masks(unlabelled, tmp_path, watched):
    run = here("report", unlabelled.recording, "-o", tmp_path / "page.html")
    assert run.returncode == 0, run.stderr
    seen = watched((tmp_path / "page.html").as_uri())
    assert seen.complaints == []
    assert seen.tab.locator("select.left").input_value() == "filtered: post"
    assert seen.tab.locator("select.right").input_value() == "unfiltered: post"
    first = frame(seen.tab)
    seen.tab.keyboard.press("ArrowRight")
    assert frame(seen.tab) > first


def test_without_truth_the_frames_to_look_at_are_pictured_first(unlabelled, monkeypatch):
    monkeypatch.setattr(frames, "PICTURED", 3)
    strips = frames.strips_of(DriveResult(unlabelled.recording), 10**9)
    look_at = unlabelled.summary["unlabelled"]["look_at"]
    assert [each.frame for each in strips] == sorted(look_at[:3])


# --- Comparisons ----------------------------------------------------------------------------------


def test_a_comparison_is_a_page_with_the_changes_and_the_frames_that_changed(
    demo, tmp_path, watched
):
    path = tmp_path / "compared.html"
    run = here("compare", demo.recording, "-o", path, "--json")
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    seen = watched(path.as_uri())
    assert seen.complaints == []
    assert seen.elsewhere == []
    assert seen.tab.locator(".verdict").inner_text() == told["verdict"]
    rows = seen.tab.locator("#what-changed table").first.locator("tbody tr")
    assert rows.count() == sum(3 if row["final"] else 1 for row in told["changes"])
    moved = {str(row["frame"]) for row in told["moved"]}
    assert len(moved) > 1
    assert moved <= {*seen.tab.locator("tbody th, tbody td").all_inner_texts()}
    assert violations(seen.tab) == []


@pytest.fixture(scope="module")
def made(demo, tmp_path_factory):
    """The demo's report, made where neither the log nor the results folder is at hand."""
    folder = tmp_path_factory.mktemp("elsewhere")
    shutil.copy(demo.recording, folder / "drive.rrd")
    run = roadeval("report", "drive.rrd", "-o", "report.pdf", cwd=folder)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "report.pdf\n"
    return (folder / "report.pdf").read_bytes()


def test_a_drive_has_eight_pages_at_most_and_no_frame_twice(made):
    pages = [page.extract_text() for page in PdfReader(io.BytesIO(made)).pages]
    assert len(pages) <= 8
    frames = re.findall(r"^Frame (\d+)$", "\n".join(pages), re.MULTILINE)
    assert len(set(frames)) == len(frames) > 2
    (figure,) = (page for page in pages if "The paper's figure 2: input" in page)
    assert figure.count("truth") >= 4


KILLED = """
import os, signal, sys
from roadeval import configure, replay

def kill(progress):
    if progress.stage == "replaying" and progress.done == int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)

replay(sys.argv[1], configure({"run": {"jobs": 1}}), save="out.rrd", on_progress=kill)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """The partial recording of a run on sparse truth that is killed at its 42nd of 60 frames."""
    folder, noise = tmp_path_factory.mktemp("killed"), np.random.default_rng(0)
    road = np.repeat(np.uint8([0, 255]), 60)[:, None].repeat(160, axis=1)
    with LogWriter(folder / "drive.mcap") as log:
        for stamp in range(1, 61):
            image = noise.integers(0, 256, (*road.shape, 3), np.uint8)
            log.image("/camera", stamp * 10**8, cv2.imencode(".jpg", image)[1].tobytes(), "jpeg")
            if stamp % 3 == 1:
                log.mask("/road_mask", stamp * 10**8, road)
    command = [sys.executable, "-c", KILLED, "drive.mcap", "42"]
    assert subprocess.run(command, cwd=folder, check=False).returncode == -signal.SIGKILL
    (partial,) = folder.glob("out.*.partial.rrd")
    return partial


def test_a_killed_run_gives_a_report_of_its_readable_part_marked_on_page_1(killed, tmp_path):
    run = here("report", killed, "-o", tmp_path / "report.pdf")
    assert run.returncode == 0, run.stderr
    assert "a partial recording" in run.stderr
    for command in (("inspect", killed, "--list"), ("compare", killed)):
        assert "a partial recording" in here(*command).stderr
    pages = [page.extract_text() for page in PdfReader(tmp_path / "report.pdf").pages]
    first = pages[0]
    assert not any("Where the final masks go wrong" in page for page in pages)
    assert any("If a stage were perfect" in page for page in pages)
    assert "This run did not reach its end" in first
    (evaluated,) = re.findall(r"(\d+) frames? w\w+ evaluated", first)
    # Of the 20 frames with truth ten are trained on, and six more come before the end.
    assert 0 < int(evaluated) < 10


def test_a_killed_run_of_sparse_truth_shows_no_scored_frame_whose_truth_is_missing(killed):
    opened = DriveResult(killed)
    seen = set(opened.pictured)
    scored = set(opened.rows["frame"])
    assert len(seen & scored) > 1
    for frame in seen & scored:
        opened.recording.truth(frame)
        opened.recording.layer("unfiltered", "errors", frame)


def test_the_same_result_gives_the_same_file_and_nothing_is_left_beside_nor_fetched(
    demo, made, tmp_path, monkeypatch
):
    monkeypatch.setattr(socket.socket, "connect", lambda *_: pytest.fail("a connection"))
    monkeypatch.chdir(tmp_path)
    shutil.copy(demo.recording, "drive.rrd")
    assert here("report", "drive.rrd", "-o", "again.pdf").returncode == 0
    assert (tmp_path / "again.pdf").read_bytes() == made
    assert {file.name for file in tmp_path.iterdir()} == {"again.pdf", "drive.rrd"}


def test_a_report_of_another_kind_is_wrong_usage(demo, tmp_path):
    run = here("report", demo.recording, "-o", "page.txt", cwd=tmp_path)
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())
