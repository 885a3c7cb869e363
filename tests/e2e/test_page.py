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

from roadeval import Recording
from roadeval.data import ERRORS
from roadeval.jobs.results import page
from roadeval.jobs.results.result import DriveResult
from roadeval.report.images import LayerImage, paint
from tests.e2e.commands import DEMO, here, roadeval
from tests.fixtures.browser import missing, violations, wait_until
from tests.fixtures.logged import jpeg, write_drive
from tests.jobs.test_classes import write_ids
from tests.networks.making import red_network
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
    (next(p for p in folder.glob("results/drive_0013*") if p.is_dir()) / "report.html").write_text(
        "the page of a drive"
    )
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


@pytest.fixture
def table(tab):
    """The page of the demo in a tab, with the table of all frames unfolded."""
    tab.locator(".all summary").click()
    return tab


def drag(tab, chart, start, end):
    """Drag over a part of a chart, from and to shares of its width."""
    chart.scroll_into_view_if_needed()
    box = None
    while box != (box := chart.bounding_box()):  # The film may still grow above.
        tab.wait_for_timeout(200)
    tab.mouse.move(box["x"] + box["width"] * start, box["y"] + box["height"] / 2)
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] * end, box["y"] + box["height"] / 2, steps=5)
    tab.mouse.up()


def address(tab):
    """The address as the page has it; ``tab.url`` learns of a change only some time later."""
    return tab.evaluate("location.href")


def frame(tab):
    """The number of the frame that is looked at."""
    return int(re.match(r"Frame (\d+)", tab.locator(".where").inner_text())[1])


# --- A page of one drive --------------------------------------------------------------------------


def test_a_page_is_one_file_of_at_most_6_mb_and_asks_for_nothing(drive, watched):
    assert drive.stat().st_size < 6_000_000
    assert {each.name for each in drive.parent.iterdir()} == {"page.html", "drive.rrd"}
    seen = watched(drive.as_uri())
    assert seen.elsewhere == []
    assert [url for url in seen.requests if url.startswith("file:")] == [drive.as_uri()]
    assert seen.complaints == []


def test_every_evaluated_frame_is_in_the_table_with_its_rates(table, demo):
    tab = table
    rows = tab.locator(".frames tbody tr")
    assert rows.count() == demo.summary["frames"]["evaluated"]
    columns = tab.locator(".frames thead th[data-rate=ERR]").all_inner_texts()
    assert [each.strip() for each in columns] == ["filtered", "unfiltered", "blind"]
    values = rows.evaluate_all("rows => rows.map(row => Number(row.cells[2].textContent))")
    mean = demo.summary["totals"]["filtered"]["post"]["ERR"]
    assert sum(values) / len(values) == pytest.approx(100 * mean, abs=0.01)


def test_a_click_on_a_title_sorts_and_another_one_turns_it_round(table):
    tab = table
    title = tab.locator(".frames thead th[data-rate=ERR] button").first
    read = "rows => rows.map(row => Number(row.cells[2].textContent))"
    title.click()
    values = tab.locator(".frames tbody tr").evaluate_all(read)
    assert values == sorted(values, reverse=True)
    title.press("Enter")
    assert tab.locator(".frames tbody tr").evaluate_all(read) == sorted(values)
    assert tab.locator(".frames th[aria-sort]").get_attribute("aria-sort") == "ascending"


def test_frames_are_filtered_by_variant_rate_and_condition(table):
    tab = table
    everything = tab.locator(".frames tbody tr").count()
    tab.select_option("[name=focus]", "unfiltered")
    tab.select_option("[name=beside]", label="none")
    assert shown(tab, ".frames thead th[data-variant]") == ["unfiltered"] * 3
    tab.fill("[name=least]", "20")
    rates = [float(text) for text in shown(tab, ".frames tbody td:nth-child(4)")]
    assert 0 < len(rates) < everything
    assert min(rates) >= 20
    tab.click(".filters [type=reset]")
    tab.select_option("[name=beside]", label="all variants")
    wait_until(tab, "document.querySelectorAll('.frames tr[hidden]').length === 0")
    tab.select_option("[name=condition]", label="the filter helps")
    notes = shown(tab, ".frames tbody td:last-child")
    assert 0 < len(notes) < everything
    assert all("the filter helps" in note for note in notes)
    errors = (shown(tab, f".frames tbody td:nth-child({column})") for column in (3, 4))
    assert all(float(with_) < float(without) for with_, without in zip(*errors, strict=True))


def test_the_worst_frame_is_seen_first_and_arrow_keys_go_to_every_frame(tab, demo):
    rows = pd.read_csv(demo.reports / "frames.csv").query(
        "variant == 'filtered' and stage == 'post'"
    )
    worst = int(rows.loc[rows["ERR"].idxmax(), "frame"])
    assert frame(tab) == worst
    tab.keyboard.press("ArrowRight")
    assert frame(tab) == worst + 1
    tab.keyboard.press("ArrowLeft")
    assert frame(tab) == worst
    assert tab.locator(".frames tr[aria-current]").get_attribute("data-frame") == str(worst)
    cells = tab.locator(".about tbody tr").first.locator("td").all_inner_texts()
    row = rows.set_index("frame").loc[worst]
    assert cells == [f"{100 * row[rate]:.2f}" for rate in ("ERR", "FPR", "FNR")]


def test_the_link_below_the_verdict_leads_to_the_worst_frame(tab, demo):
    tab.keyboard.press("ArrowRight")
    link = tab.locator("#summary .links a")
    link.click()
    rows = pd.read_csv(demo.reports / "frames.csv").query(
        "variant == 'filtered' and stage == 'post'"
    )
    worst = int(rows.loc[rows["ERR"].idxmax(), "frame"])
    assert frame(tab) == worst
    command = tab.locator("#summary .links code").inner_text()
    assert command == f"roadeval inspect drive.rrd --frame {worst}"


def test_the_address_names_the_frame_and_back_goes_to_the_last_one(table, drive, watched):
    tab = table
    first = frame(tab)
    assert "#" not in address(tab)
    one, two = (
        int(row.get_attribute("data-frame")) for row in tab.locator("tr.pictured").all()[1:3]
    )
    for number in (one, two):
        tab.locator(f".frames tr[data-frame='{number}'] a").click()
        assert address(tab).endswith(f"#frame-{number}")
    tab.locator(".where").click()
    tab.keyboard.press("ArrowRight")
    assert address(tab).endswith(f"#frame-{frame(tab)}")
    assert frame(tab) == two + 1
    tab.go_back()
    assert frame(tab) == one
    tab.go_back()
    assert frame(tab) == first
    assert frame(watched(f"{drive.as_uri()}#frame-{two}").tab) == two


def picture_of(tab, canvas):
    """A picture of the film, ``(H, W, 3)``; a canvas has 300x150 pixels until it is drawn."""
    size = f"document.querySelector('.views .{canvas}').width"
    tab.wait_for_function(f"() => {size} !== 300")
    shape, pixels = tab.locator(f".views .{canvas}").evaluate(
        "c => [[c.height, c.width, 4], "
        "[...c.getContext('2d').getImageData(0, 0, c.width, c.height).data]]"
    )
    return np.array(pixels, int).reshape(shape)[..., :3]


@pytest.mark.sweep
def test_the_film_shows_the_errors_of_every_frame(tab, demo):
    recording = Recording(demo.recording)

    def distance(picture, variant, number):
        """How far a picture is from a frame's errors over its image, as a report paints them."""
        errors = recording.layer(variant, ERRORS.name, number)
        painted = paint(LayerImage("", recording.image(number), ERRORS, errors))
        size = picture.shape[1::-1]
        return np.abs(cv2.resize(painted, size, interpolation=cv2.INTER_AREA) - picture).mean()

    for number in (80, 81, 43):
        tab.evaluate(f"location.hash = '#frame-{number}'")
        wait_until(tab, f"document.querySelector('.where').textContent.includes('{number} ')")
        tab.wait_for_timeout(400)
        for canvas, variant in (("above", "filtered"), ("below", "unfiltered")):
            picture = picture_of(tab, canvas)
            assert distance(picture, variant, number) < 6
            assert distance(picture, variant, number + 3) > 12


def test_a_browser_that_cannot_play_the_film_shows_the_pictures_of_the_worst_frames(
    drive, tmp_path, watched
):
    page = drive.read_text().replace("data:video/webm;base64,", "data:video/webm;base64,AAAA")
    (tmp_path / "page.html").write_text(page)
    tab = watched((tmp_path / "page.html").as_uri()).tab
    wait_until(tab, "document.querySelector('.stage').hidden")
    assert tab.locator(".strip:visible .pictures.main img").count() == 4
    assert tab.locator(".play").is_hidden()


def test_it_plays_to_the_end_of_the_chosen_part_and_stops(tab):
    drag(tab, tab.locator(".ribbons .area").first, 0.3, 0.45)
    while tab.locator(".previous").is_enabled():
        tab.locator(".previous").click()
    first = frame(tab)
    tab.locator(".play").click()
    wait_until(tab, "document.querySelector('.play').textContent === 'Pause'")
    wait_until(tab, "document.querySelector('.play').textContent === 'Play'")
    last = int(re.search(r"range=\d+-(\d+)", address(tab))[1])
    assert first < frame(tab) == last


def test_a_part_of_the_drive_narrows_tables_charts_and_the_verdict(table, demo, watched):
    tab = table
    whole = tab.locator(".verdict").inner_text()
    drag(tab, tab.locator(".ribbons .area").first, 0.2, 0.5)
    low, high = map(int, re.search(r"range=(\d+)-(\d+)", address(tab)).groups())
    rows = pd.read_csv(demo.reports / "frames.csv").query("stage == 'post'")
    rows = rows[rows["frame"].between(low, high)]
    means = rows.groupby("variant")[["ERR", "FPR", "FNR"]].mean() * 100
    for row in tab.locator("table[data-name=rates] tbody tr").all():
        name, *cells = row.locator("th, td").all_inner_texts()
        assert cells[:3] == [f"{value:.2f}" for value in means.loc[name]]
    sentence = tab.locator(".verdict").inner_text()
    assert sentence.startswith(f"Frames {low} to {high} ({rows['frame'].nunique()})")
    assert all(f"{value:.1f} %" in sentence for value in means.loc["filtered"])
    assert low <= frame(tab) <= high
    numbers = [int(text) for text in shown(tab, ".frames tbody th")]
    assert (min(numbers), max(numbers)) == (low, high)
    views = tab.locator(".along .area").evaluate_all(
        "all => all.map(a => a.getAttribute('viewBox'))"
    )
    assert len(views) > 4
    assert len({(view.split()[0], view.split()[2]) for view in views}) == 1
    again = watched(address(tab)).tab
    assert again.locator(".verdict").inner_text() == sentence
    tab.locator(".whole:visible").first.click()
    assert tab.locator(".verdict").inner_text() == whole
    assert "range" not in address(tab)


def test_why_follows_the_focus_and_leads_to_its_frames(tmp_path, watched):
    write_ids(tmp_path / "ids.mcap", 16)
    (tmp_path / "names.toml").write_text('[labels.names]\n3 = "road"\n4 = "verge"\n8 = "car"\n')
    truth = ["--config", "names.toml", "--road-label", "road", "--train-frames", "4"]
    run = here("replay", "ids.mcap", *truth, "--save", "ids.rrd", cwd=tmp_path)
    assert "Why filtered errs:\n- " in run.stdout, run.stderr
    assert here("report", "ids.rrd", "-o", "page.html", cwd=tmp_path).returncode == 0
    tab = watched((tmp_path / "page.html").as_uri()).tab
    for focus in ("filtered", "unfiltered"):
        tab.select_option("[name=focus]", focus)
        assert shown(tab, ".list.plain h4")[0] == f"Why {focus} errs"
        (first, *_) = shown(tab, f"[data-focus={focus}] li")
        assert re.match(r"\d+ % of the false road is (verge|car)", first)
    link = tab.locator("[data-focus=unfiltered] a").first
    link.click()
    assert frame(tab) == int(link.inner_text())
    assert address(tab).endswith(f"#frame-{frame(tab)}&focus=unfiltered")


def test_a_part_may_be_dragged_over_the_edge_of_a_chart(tab):
    drag(tab, tab.locator(".ribbons .area").first, 0.7, 1.1)
    low, high = map(int, re.search(r"range=(\d+)-(\d+)", address(tab)).groups())
    assert tab.locator(".verdict").inner_text().startswith(f"Frames {low} to 99 ")
    assert high >= 99
    assert "of the chosen part" in tab.locator("table[data-name=rates] caption").inner_text()
    assert tab.locator(".ribbons .whole:visible").count() == 1


@pytest.mark.parametrize("address", ["#%E0%A4%A", "#frame-9999", "#frame-80&range=500-600"])
def test_an_address_that_names_nothing_shows_the_worst_frame_of_the_drive(drive, watched, address):
    seen = watched(drive.as_uri() + address)
    assert seen.complaints == []
    assert frame(seen.tab) == 80
    assert seen.tab.locator(".verdict").inner_text().startswith("filtered: 2.8 %")


def test_the_focus_changes_verdict_pictures_and_frames_and_stands_in_the_address(
    tab, demo, watched
):
    tab.select_option("[name=focus]", "unfiltered")
    rows = pd.read_csv(demo.reports / "frames.csv").query(
        "variant == 'unfiltered' and stage == 'post'"
    )
    worst = int(rows.loc[rows["ERR"].idxmax(), "frame"])
    assert tab.locator(".verdict").inner_text().startswith("unfiltered: 12.0 % of the pixels")
    assert tab.locator("#summary .links a").inner_text().startswith(f"Worst frame: {worst}, where")
    assert frame(tab) == worst
    assert "Worst frames of unfiltered" in tab.locator(".about .worst").inner_text()
    assert tab.locator("select.left").input_value() == "unfiltered: errors"
    assert address(tab).endswith(f"#frame-{worst}&focus=unfiltered")
    again = watched(address(tab)).tab
    assert again.locator(".verdict").inner_text() == tab.locator(".verdict").inner_text()
    assert again.locator("[name=focus]").input_value() == "unfiltered"


def test_a_click_on_a_ribbon_shows_its_frame_and_nothing_jumps(tab):
    ribbon = tab.locator(".ribbons .area").nth(1)
    ribbon.scroll_into_view_if_needed()
    before = tab.evaluate("scrollY")
    box = ribbon.bounding_box()
    tab.mouse.move(box["x"] + box["width"] * 0.4, box["y"] + box["height"] / 2)
    number = int(re.match(r"frame (\d+)", tab.locator(".tip:visible").inner_text())[1])
    tab.mouse.down()
    tab.mouse.up()
    assert frame(tab) == number
    assert tab.evaluate("scrollY") == before
    ribbon.focus()
    tab.keyboard.press("ArrowRight")
    assert frame(tab) == number + 1


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """A replay of a network with probabilities of every size, the arguments of it, and its page."""
    folder = tmp_path_factory.mktemp("graded")
    red_network(folder / "red.onnx")
    words = ["--net", f"mine={folder / 'red.onnx'}", "--only", "mine", "--max-frames", "12"]
    run = here("replay", DEMO, *words, "--save", folder / "out.rrd", "--reports", folder / "out")
    assert run.returncode == 0, run.stderr
    run = here("report", folder / "out.rrd", "-o", folder / "page.html")
    assert run.returncode == 0, run.stderr
    return folder


@pytest.mark.sweep
def test_a_moved_threshold_gives_the_rates_of_a_replay_at_it(graded, watched, tmp_path):
    tab = watched((graded / "page.html").as_uri()).tab
    slider, told = tab.locator(".threshold input"), tab.locator(".threshold p")
    before, picture = told.inner_text(), picture_of(tab, "above")
    slider.fill("40")
    assert told.inner_text() != before
    assert (picture_of(tab, "above") != picture).any()
    assert "threshold=40" in address(tab)
    (tmp_path / "red.toml").write_text(tab.locator(".threshold code").inner_text())
    words = ["--net", f"mine={tmp_path / 'red.toml'}", "--only", "mine", "--max-frames", "12"]
    run = here("replay", DEMO, *words, "--record", "none", "--reports", tmp_path / "out", "--json")
    assert run.returncode == 0, run.stderr
    rates = json.loads(run.stdout)["totals"]["mine"]["net"]
    stated = [f"{rate} {100 * rates[f'pooled_{rate}']:.2f} %" for rate in ("ERR", "FPR", "FNR")]
    assert told.inner_text() == f"All pixels of the drive: {', '.join(stated)}."
    tab.click(".threshold >> text=Reset")
    assert told.inner_text() == before


def test_a_slider_lies_between_two_variants(tab):
    assert tab.locator("select.left").input_value() == "filtered: errors"
    assert tab.locator("select.right").input_value() == "unfiltered: errors"
    above, below = (tab.locator(f".views .{name}") for name in ("above", "below"))
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
    assert "camera" in below.get_attribute("aria-label")
    tab.locator(".where").click()
    tab.keyboard.press("ArrowRight")
    assert tab.locator("select.right").input_value() == "camera"


def test_the_picture_enlarges_and_arrow_keys_go_on_inside(tab):
    first = frame(tab)
    tab.locator(".views").click(position={"x": 30, "y": 30})
    assert tab.locator("dialog .views").is_visible()
    tab.keyboard.press("ArrowRight")
    assert frame(tab) > first
    tab.keyboard.press("Escape")
    tab.locator("dialog .views").wait_for(state="detached")
    assert tab.locator(".viewer .views").is_visible()


def test_a_variant_beside_the_focus_is_shown_alone_with_it(tab):
    tab.select_option("[name=focus]", "unfiltered")
    tab.select_option("[name=beside]", "blind")
    assert set(shown(tab, ".legend li")) & {"filtered", "unfiltered", "blind"} == {
        *("unfiltered", "blind")
    }
    assert not [part for part in tab.locator("g[data-of=filtered]").all() if part.is_visible()]
    assert shown(tab, "#summary tbody th") == ["unfiltered", "blind"]
    tab.click("text=Rates along the drive")
    numbers = tab.locator(".more figure .chart .ys").first.locator("text")
    assert float(numbers.last.text_content()) >= 20
    tab.select_option("[name=beside]", "-")
    tab.select_option("[name=focus]", "blind")
    assert float(numbers.last.text_content()) < 15
    tab.select_option("[name=focus]", "unfiltered")
    tab.select_option("[name=beside]", "blind")
    tab.locator(".rows").first.locator(".row").nth(2).hover()
    assert "\nfiltered" not in tab.locator(".tip:visible").inner_text()
    tab.select_option("[name=beside]", label="all variants")
    assert shown(tab, "#summary tbody th") == ["filtered", "unfiltered", "blind"]


@pytest.mark.parametrize(
    ("width", "scheme"),
    [(1440, "light"), pytest.param(390, "dark", marks=pytest.mark.sweep)],
)
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
    assert shown(tab, ".ribbons .axis")
    outcomes = tab.locator(".strip > .pictures img")
    assert all(each.is_visible() for each in outcomes.all()[:20])
    tab.locator(".strip summary").first.click()
    assert tab.locator(".strip").first.locator("img").last.is_visible()
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
    drives = seen.tab.locator(".drive")
    assert drives.count() == told["counts"]["scored"] + told["counts"]["damaged"]
    assert drives.first.locator("img").count() == 3
    assert drives.first.locator("a").inner_text() == "drive_0013"
    assert seen.tab.locator(".drive a").count() == 1
    pictures = seen.tab.locator(".grid img")
    assert pictures.count() > 5
    pictures.first.scroll_into_view_if_needed()
    wait_until(seen.tab, "document.querySelector('.grid img').naturalWidth > 0")
    assert all(url.startswith((fleet.as_uri(), "data:")) for url in seen.requests)
    assert seen.complaints == []
    drives.first.locator("a").click()
    assert seen.tab.inner_text("body") == "the page of a drive"


def test_without_truth_a_page_shows_the_masks(unlabelled, tmp_path, watched):
    run = here("report", unlabelled.recording, "-o", tmp_path / "page.html")
    assert run.returncode == 0, run.stderr
    seen = watched((tmp_path / "page.html").as_uri())
    assert seen.complaints == []
    assert seen.tab.locator("select.left").input_value() == "filtered: mask"
    assert seen.tab.locator("select.right").input_value() == "unfiltered: mask"
    first = frame(seen.tab)
    seen.tab.keyboard.press("ArrowRight")
    assert frame(seen.tab) > first


def test_without_truth_the_frames_to_look_at_are_pictured_first(unlabelled, monkeypatch):
    monkeypatch.setattr(page, "PICTURED", 3)
    strips = page.strips_of(DriveResult(unlabelled.recording), 10**9)
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
    text = "\n".join(pages)
    assert text.partition("in the paper's figure 2.")[2].count("truth") >= 4


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
    images = {n: jpeg(noise.integers(0, 256, (*road.shape, 3), np.uint8)) for n in range(1, 61)}
    messages = {
        n: {"/camera": images[n], "/road_mask": road if n % 3 == 1 else None} for n in images
    }
    write_drive(folder / "drive.mcap", ((n * 10**8, each) for n, each in messages.items()))
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
