"""Errors are data; their sentence names settings as the place needs where it is read."""

import ast
import pickle
import re
from copy import deepcopy
from pathlib import Path

import roadeval
from roadeval import RoadevalError
from roadeval.cli.options import with_flags
from roadeval.networks.settings import NetSettings
from roadeval.recording.layout import RecordingError, SeveralCamerasError
from roadeval.runtime.sentence import Sentence, Setting

ERROR = RoadevalError(
    "7 does not occur",
    where="/labels",
    setting="labels.road",
    remedy=Sentence("see {labels.ignore}"),
)


def test_a_sentence_is_made_of_place_setting_problem_and_remedy():
    assert str(ERROR) == "/labels: `labels.road`: 7 does not occur; see `labels.ignore`"
    assert str(RoadevalError("no frame", where="a.mcap")) == "a.mcap: no frame"
    assert str(RoadevalError("no frame")) == "no frame"


def test_the_terminal_names_flags():
    shown = "/labels: --road-label: 7 does not occur; see --ignore-label"
    assert with_flags(ERROR.sentence) == shown


def test_in_a_file_settings_are_named_as_they_stand_there():
    error = RoadevalError.of(ERROR, "run.toml", in_file=True)
    shown = "run.toml: /labels: labels.road: 7 does not occur; see labels.ignore"
    assert with_flags(error.sentence) == str(error) == shown
    assert (error.where, error.setting) == ("run.toml: /labels", "labels.road")


def test_another_room_s_error_keeps_its_parts():
    error = RecordingError.of(ERROR)
    assert type(error) is RecordingError
    assert (error.where, error.problem, error.remedy) == (
        ERROR.where,
        ERROR.problem,
        ERROR.remedy,
    )


def test_settings_can_be_those_of_another_table():
    error = ERROR.rename_settings(lambda setting: f"masks.net.{setting}")
    assert error.setting == "masks.net.labels.road"
    assert error.remedy == "see `masks.net.labels.ignore`"
    assert ERROR.setting == "labels.road"


def test_an_error_passes_between_processes_with_its_parts():
    copy = pickle.loads(pickle.dumps(ERROR))
    assert vars(copy) == vars(ERROR)
    assert copy.sentence.parts == ERROR.sentence.parts
    several = pickle.loads(pickle.dumps(SeveralCamerasError("a.rrd", ["front", "rear"])))
    assert several.cameras == ["front", "rear"]
    assert "name one of front, rear" in str(several)


def test_a_password_is_in_no_sentence():
    error = RoadevalError("cannot be read", where="https://me:secret@host/a.mcap?key=1")
    assert str(error) == "https://host/a.mcap: cannot be read"


def test_sentences_keep_their_settings_when_they_are_joined_and_copied():
    advice = Sentence("lower {frames.scale}")
    both = Sentence("; ").join(["too large", advice])
    assert both == "too large; lower `frames.scale`"
    assert with_flags(deepcopy(both)) == "too large; lower --scale"
    assert with_flags("a `frames.scale` of plain text") == "a `frames.scale` of plain text"


def test_settings_and_values_are_put_into_a_template_and_not_into_values():
    sentence = Sentence("{} of {}: see {frames.scale}", 3, "a{b.c}{}.mcap")
    assert sentence == "3 of a{b.c}{}.mcap: see `frames.scale`"
    assert sentence.parts[-1] == Setting("frames.scale")


def test_templates_name_settings_that_there_are():
    tables = roadeval.configure({"preset": "robust"}).as_dict() | {"net": vars(NetSettings())}
    names = {f"{table}.{key}" for table, own in tables.items() if own for key in own}
    names |= {*tables, "masks", "only", "tunes"}
    package = Path(roadeval.__file__).parent
    for path in package.rglob("*.py"):
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Sentence":
                template = getattr(call.args[0], "value", "")
                # The settings of one table name each other without it.
                is_full = path.name != "settings.py"
                named = {n for n in re.findall(r"{([\w.]+)}", template) if is_full or "." in n}
                assert named <= names, path
