"""``roadeval serve`` in a real browser: pictures on demand, and the viewer."""

import re
from datetime import date

import pytest

import roadeval
from tests.e2e.serving import serving, status
from tests.e2e.test_fleet import Here, write
from tests.fixtures.browser import missing, violations, wait_until

if reason := missing():
    pytest.skip(reason, allow_module_level=True)


def frame(tab):
    return int(re.match(r"Frame (\d+)", tab.locator(".where").inner_text())[1])


def test_every_result_is_listed_and_a_click_away(address, watched):
    seen = watched(address)
    links = seen.tab.locator("table a")
    assert links.count() == 3
    says = seen.tab.locator("tbody tr").first.inner_text()
    assert "of the pixels are wrong." in says
    assert str(date.today().year) in says
    for place, title in enumerate(["demo", "demo", "week"]):
        seen.tab.goto(address)
        links.nth(place).click()
        assert seen.tab.locator("h1").inner_text() == title
    seen.tab.get_by_text("All results").click()
    assert links.count() == 3
    assert violations(seen.tab) == []
    assert seen.complaints == []
    assert all(url.startswith(address) for url in seen.elsewhere)


def test_every_frame_has_its_pictures_when_it_is_asked_for(address, demo, watched):
    seen = watched(f"{address}0/")
    rows = seen.tab.locator(".frames tr.pictured")
    assert rows.count() == demo.summary["frames"]["evaluated"]
    seen.tab.locator(".stage").wait_for()
    for place in (3, 40):
        rows.nth(place).locator("td").first.click()
        number = int(rows.nth(place).get_attribute("data-frame"))
        seen.tab.locator(f"#frame-{number} .tile img").first.wait_for()
        assert frame(seen.tab) == number
        loaded = "each => each.complete && each.naturalWidth > 0"
        wait_until(seen.tab, f"({loaded})(document.querySelector('.views .above'))")
    seen.tab.keyboard.press("ArrowRight")
    seen.tab.locator(f"#frame-{number + 1} .tile").first.wait_for()
    assert seen.complaints == []
    assert violations(seen.tab) == []


def test_the_address_of_a_frame_leads_to_the_page_that_shows_it(address, watched):
    tab = watched(f"{address}0/frame/40").tab
    tab.wait_for_url(f"{address}0/#frame-40")
    tab.locator("#frame-40 .tile img").first.wait_for()
    assert frame(tab) == 40


def test_where_there_is_no_screen_the_page_says_what_to_do_instead(demo, watched, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with serving(demo.recording) as (address, _):
        seen = watched(address)
        seen.tab.locator(".stage").wait_for()
        seen.tab.locator(".open").click()
        seen.tab.locator(".absent").wait_for()
        assert "No screen" in seen.tab.locator(".absent").inner_text()


def test_a_fleets_frame_whose_recording_was_not_kept_says_why_it_cannot_be_had(address, watched):
    tab = watched(f"{address}2/").tab
    tab.locator(".opens").first.click()
    tab.get_by_text("no recording was kept").wait_for()


@pytest.fixture
def fleet(tmp_path):
    """A fleet of two drives whose logs are there and whose recordings are not."""
    for place, name in enumerate("ab"):
        write(tmp_path / "logs" / f"{name}.mcap", 100 * place)
    config = roadeval.configure({"training": {"frames": 4}})
    roadeval.replay_fleet([tmp_path / "logs"], tmp_path / "week", config, executor=Here())
    return tmp_path / "week"


def test_a_fleet_leads_to_its_drives_and_they_lead_back(fleet, watched):
    with serving(fleet) as (address, _):
        seen = watched(f"{address}0/")
        tab = seen.tab
        for place, name in enumerate("ab"):
            tab.goto(f"{address}0/")
            tab.locator("#all-drives tbody a").get_by_text(name, exact=True).click()
            tab.wait_for_url(f"{address}0/drive/{place}/")
            assert tab.locator("h1").inner_text() == name
            assert "Made without pictures" in tab.content()
            tab.get_by_role("link", name="week").click()
            tab.wait_for_url(f"{address}0/")
        worst = roadeval.Result(fleet).worst.iloc[0]
        tab.locator("#the-worst-frames-over-all-drives tbody a").nth(1).click()
        tab.wait_for_url(f"**/#frame-{worst.frame}")
        assert tab.locator(".frames tr[aria-current]").get_attribute("data-frame") == str(
            worst.frame
        )
        assert seen.complaints == []
        assert status(f"{address}0/drive/2/") == 404
        assert status(f"{address}0/drive/0/frame/10/view", method="POST") == 403
