"""The published JSON schemas say what the code reads and writes."""

import json
import runpy
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import roadeval
from tests.e2e.commands import here
from tests.golden import drive

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = ROOT / "docs" / "schemas"


def validator(name):
    schema = json.loads((SCHEMAS / f"{name}.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


RUN, SUMMARY = validator("run"), validator("summary")


def test_the_schemas_are_those_of_the_code():
    schemas = runpy.run_path(str(ROOT / "docs" / "schemas.py"))
    for name, made in (("run", schemas["of_run"]()), ("summary", schemas["of_summary"]())):
        text = json.loads((SCHEMAS / f"{name}.schema.json").read_text())
        assert text == made, "out of date: run python docs/generated.py"


@pytest.mark.parametrize("preset", RUN.schema["properties"]["preset"]["enum"])
def test_every_preset_is_valid(preset):
    more = {"variants": {"wide": {"preset": "paper", "shadow": {"ring_width": 2}}}}
    RUN.validate(
        tomllib.loads(roadeval.config_toml(roadeval.configure({"preset": preset, **more})))
    )


@pytest.mark.parametrize(
    "text",
    [
        'preset = "papre"',
        "chain = 3",
        "[shadow]\nring_width = 99",
        "[shadow]\nrings = 1",
        "[frames]\nevery = 0",
        "[variants.wide.shadow]\nthreshold = 'magic'",
        "[[cameras]]\nname = 'front'\nimage = 3",
    ],
)
def test_what_a_run_refuses_is_not_valid(text):
    with pytest.raises(roadeval.RoadevalError):
        roadeval.configure(tomllib.loads(text))
    assert not RUN.is_valid(tomllib.loads(text))


def test_a_table_of_somebody_elses_stage_is_valid():
    assert RUN.is_valid({"chain": ["mine:road", "post"], "road": {"top": 0.3}})


def test_the_summaries_of_a_drive_and_of_one_without_truth_are_valid(tmp_path):
    for truths in (True, False):
        log = drive.write(tmp_path / f"{truths}.mcap", frames=26, truths=truths)
        tables = {"output": {"figures": False}, "frames": {"disturb": ["fog:1"]}}
        config = roadeval.configure(tables)
        outcome = roadeval.replay(log, config=config, reports=tmp_path / str(truths))
        summary = json.loads((outcome.reports / "summary.json").read_text())
        SUMMARY.validate(summary)
        assert not SUMMARY.is_valid({**summary, "totals": 3})
        assert {*summary} <= {*SUMMARY.schema["$defs"]["Facts"]["properties"]}


def test_the_printed_configuration_names_its_schema():
    first = here("config").stdout.partition("\n")[0]
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["urls"]
    place = f"raw/v{roadeval.__version__}/docs/schemas/run.schema.json"
    assert first == f"#:schema {urls['Repository']}/{place}"
