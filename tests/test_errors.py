"""Errors are data; their sentence names settings as the place needs where it is read."""

import pickle
from copy import deepcopy

from roadeval.cli.options import with_flags
from roadeval.errors import RoadevalError
from roadeval.recording.layout import RecordingError, SeveralCamerasError
from roadeval.runtime.sentence import Sentence, Setting

ERROR = RoadevalError(
    "7 does not occur",
    where="/labels",
    setting="labels.road",
    remedy=Sentence("see ", Setting("labels.ignore")),
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
    advice = Sentence("lower ", Setting("frames.scale"))
    both = Sentence("; ").join(["too large", advice])
    assert both == "too large; lower `frames.scale`"
    assert with_flags(deepcopy(both)) == "too large; lower --scale"
    assert with_flags("a `frames.scale` of plain text") == "a `frames.scale` of plain text"
