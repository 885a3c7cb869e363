"""What pages take from the code: nothing is missing, and every page says what the code says."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

import roadeval
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OPTIONS
from roadeval.results.schema import TABLES

DOCS = Path(__file__).resolve().parents[2] / "docs"
GENERATED = runpy.run_path(str(DOCS / "generated.py"))
PAGES = {path: path.read_text() for path in DOCS.rglob("*.md")}
MADE = {str(path.relative_to(DOCS)): text for path, text in PAGES.items() if "<!-- gen" in text}


def test_every_text_from_the_code_has_its_page():
    names = [name for text in MADE.values() for name in GENERATED["BLOCK"].findall(text)]
    assert sorted(names) == sorted(GENERATED["GENERATED"])


@pytest.mark.parametrize("page", MADE)
def test_a_page_says_what_the_code_says(page):
    text = MADE[page]
    assert text == GENERATED["written"](text), "out of date: run python docs/generated.py"
    old = text.replace("<!-- end -->", "left over\n<!-- end -->")
    assert GENERATED["written"](old) == text


def test_no_other_name_is_public():
    with pytest.raises(AttributeError, match="module 'roadeval' has no attribute 'nothing'"):
        roadeval.nothing  # noqa: B018


def test_the_site_links_every_public_name_to_its_api_page():
    text = GENERATED["page"]("reference/python", MADE["reference/python.md"])
    assert re.findall(r'"../api/roadeval.html#(\w+)"', text) == [*roadeval.__all__]


def test_every_option_and_every_setting_is_there():
    commands, settings = GENERATED["commands"](), GENERATED["settings"]()
    for option in OPTIONS:
        assert f"{option.flags[-1]} " in commands or f"{option.flags[-1]}`" in commands
        table, _, key = option.setting.partition(".")
        if key and not key.startswith("masks"):
            assert f"[{table}" in settings
            assert re.search(rf"^(# )?{key} =", settings, re.MULTILINE), option.setting


def test_the_settings_can_be_copied():
    blocks = re.findall(r"```toml\n(.*?)```", GENERATED["settings"](), re.DOTALL)
    assert len(blocks) > 15
    tables = [tomllib.loads(block) for block in blocks]
    paper = tomllib.loads(roadeval.config_toml())
    assert {"shadow": paper["shadow"]} in tables


def test_every_table_exit_code_and_public_name_is_there():
    tables = GENERATED["tables_of_a_drive"]() + GENERATED["tables_of_a_fleet"]()
    assert {*re.findall(r"### (\w+)\.", tables)} == {*TABLES}
    codes = re.findall(r"^\| (\d+) \|", GENERATED["exit_codes"](), re.MULTILINE)
    assert [*map(int, codes)] == [*ExitCode]
    names = re.findall(r"^\| `(\w+)` \|", GENERATED["python"](), re.MULTILINE)
    assert names == [*roadeval.__all__]


@pytest.mark.parametrize("name", GENERATED["COPIES"])
def test_a_page_that_is_a_file_elsewhere_leads_to_pages_of_the_site_alone(name):
    text = GENERATED["page"](name, "")
    folder = (DOCS / name).parent
    for _, _, target, _ in GENERATED["LINK"].findall(text):
        assert (folder / target).resolve() in PAGES, target
