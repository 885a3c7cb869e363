"""The results folder and its facts: what is written is read, and nothing half-done stays."""

import hashlib
import json
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roadeval.data import FrameResult, Packed, Role
from roadeval.evaluation.score.frame import BlindPrior
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings
from roadeval.results.facts import Facts, FrameAccount, LogFacts, digest_of
from roadeval.results.folder import ResultsFolder, ResultsWriter, names_of_results
from roadeval.results.schema import OF_A_DRIVE as ALL_TABLES
from roadeval.results.tables import ResultsError
from tests.evaluation.making import a_frame, a_variant, pixels
from tests.evaluation.test_scoreboard import effects_of
from tests.results.making import KEY, facts_of, lines, sum_lines

TRUTHS = [pixels("##..", "##.?"), pixels("....", "...."), pixels("###.", "....")]
MASK = pixels("#.#.", "##..")
RUN_TOML = 'preset = "paper"\n'
OF_A_DRIVE = [name for name in ALL_TABLES if name != "unlabelled"]
"""Those of a drive whose every frame has truth."""


def a_board() -> Scoreboard:
    settings = EvaluationSettings(window=2, boundary_width=1, bands=2)
    ground, _ = ground_of(None, GroundSettings(height=1.5, pitch=30, fov=60), (4, 2))
    return Scoreboard(KEY, settings, ["filtered"], BlindPrior.of_truths(TRUTHS), ground)


def scored(board: Scoreboard, role: Role = Role.EVALUATED) -> Iterator[FrameResult]:
    variant = a_variant("filtered", {"post": MASK}, {"shadow": MASK})
    variant = replace(variant, oracles={"svm": {"post": Packed.of(MASK)}})
    (stage,) = variant.stages
    graded = replace(stage.output, probability=MASK.astype(np.uint16) * 40_000)
    variant = replace(variant, stages=(replace(stage, output=graded),))
    for number, truth in enumerate(TRUTHS):
        classes = np.where(truth == 1, 0, 1 + np.arange(4) % 2).astype(np.uint8)
        frame = replace(a_frame(truth, number + 5), classes=classes)
        result = board.score(frame, role, (variant,))
        if role is Role.EVALUATED:
            result = replace(result, disturbed={"fog:2": result})
        board.add(result)
        yield result


def the_rest(board: Scoreboard) -> Facts:
    """Facts with the board's parts, and empty ones for those that it does not know."""
    account, sums = FrameAccount(evaluated=board.roles().get(Role.EVALUATED, 0)), board.summary()
    return facts_of(frames=account, effects=sums.effects, **sums.parts)


def write(folder: Path, role: Role = Role.EVALUATED) -> list[Path]:
    board = a_board()
    with ResultsWriter(folder) as writer:
        for result in scored(board, role):
            writer.append(lines(result))
        writer.append(sum_lines(board, board.summary().windows))
        files = writer.finish(the_rest(board), RUN_TOML).files
    return [folder / name for name in files]


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


OF = "street,/camera/image,"


def test_an_undefined_rate_is_an_empty_cell_and_reads_back_as_undefined(tmp_path: Path) -> None:
    write(tmp_path)
    line = (tmp_path / "frames.csv").read_text().splitlines()[3]
    assert line.startswith(f"{OF}6,600000000,600000007,filtered,post,0,4,4,0,8,0.5,0.5,,,0.5,0.5,")
    assert math.isnan(ResultsFolder(tmp_path).table("frames").loc[2, "TPR"])


@pytest.mark.parametrize("finished", [False, True])
def test_an_interrupted_run_leaves_the_earlier_results(tmp_path: Path, *, finished: bool) -> None:
    write(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    board = a_board()
    with suppress(KeyboardInterrupt), ResultsWriter(tmp_path) as writer:
        writer.append(lines(next(scored(board))))
        if finished:
            writer.finish(the_rest(board), RUN_TOML)
        raise KeyboardInterrupt
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_next_run_s_files_are_all_that_is_left_of_results_and_others_stay(
    tmp_path: Path,
) -> None:
    board = a_board()
    with ResultsWriter(tmp_path) as writer:
        (writer.folder / "fig9_weather.png").write_text("of this run alone")
        writer.append(lines(next(scored(board))))
        writer.finish(the_rest(board), RUN_TOML)
    (tmp_path / "notes.txt").write_text("mine")
    assert {"fig9_weather.png", "frames.csv", "notes.txt"} < names(tmp_path)
    written = {path.name for path in write(tmp_path)}
    assert names(tmp_path) == {*written, "notes.txt"}
    assert ResultsFolder(tmp_path).facts.files == sorted(written)


@pytest.mark.parametrize(
    "listed",
    [["../notes.txt", "/etc", "..", ".", 5, "a\0b", "\ud800x", 300 * "x"], "notes", {"a": 1}, None],
)
def test_a_summary_names_no_file_elsewhere_as_a_result(tmp_path: Path, listed: Any) -> None:
    write(tmp_path / "results")
    path = tmp_path / "results" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"files": listed}))
    assert not names_of_results(path) & {"notes.txt", "..", ".", "n", "a", "/etc"}
    (tmp_path / "results" / "folder").mkdir()
    for name in ("notes.txt", "results/n", "results/a"):
        (tmp_path / name).write_text("mine")
    write(tmp_path / "results")
    assert {"n", "a"} < names(tmp_path / "results")
    assert names(tmp_path) == {"results", "notes.txt"}


@pytest.mark.parametrize("table", OF_A_DRIVE)
def test_a_table_that_was_cut_at_the_end_of_a_line_is_refused(tmp_path: Path, table: str) -> None:
    write(tmp_path)
    path = tmp_path / f"{table}.csv"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))
    with pytest.raises(ResultsError) as caught:
        ResultsFolder(tmp_path).table(table)
    assert str(caught.value) == (
        f"{path}: does not agree with its summary ({len(lines) - 2} of {len(lines) - 1} rows); "
        "make the results again with roadeval replay"
    )


def test_a_table_with_one_number_changed_is_refused(tmp_path: Path) -> None:
    write(tmp_path)
    path = tmp_path / "heat.csv"
    path.write_text(path.read_text().replace("filtered,0,0,8,23", "filtered,0,0,8,24"))
    with pytest.raises(ResultsError, match=r"summary \(its content differs\)"):
        ResultsFolder(tmp_path).table("heat")


@pytest.mark.parametrize("table", OF_A_DRIVE)
def test_a_table_that_was_taken_away_is_missed(tmp_path: Path, table: str) -> None:
    write(tmp_path)
    (tmp_path / f"{table}.csv").unlink()
    with pytest.raises(ResultsError, match=r"\.csv: does not agree with its summary \(0 of"):
        ResultsFolder(tmp_path).table(table)


def test_the_summary_states_what_sha256sum_says(tmp_path: Path) -> None:
    write(tmp_path)
    stated = ResultsFolder(tmp_path).facts.tables
    assert list(stated) == list(OF_A_DRIVE)
    for name, told in stated.items():
        content = (tmp_path / f"{name}.csv").read_bytes()
        assert told.sha256 == hashlib.sha256(content).hexdigest()
        assert told.rows == len(ResultsFolder(tmp_path).table(name))


def test_a_run_that_scored_nothing_writes_no_tables_and_leaves_no_older_ones(
    tmp_path: Path,
) -> None:
    write(tmp_path)
    assert [path.name for path in write(tmp_path, Role.TRAINING)] == ["run.toml", "summary.json"]
    assert names(tmp_path) == {"run.toml", "summary.json"}
    assert ResultsFolder(tmp_path).table("frames").empty
    assert "ERR" in ResultsFolder(tmp_path).table("frames")


def test_a_folder_that_cannot_be_written_is_one_line_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(ResultsError, match=r"cannot be written: .*with `output\.reports`") as caught,
        ResultsWriter(tmp_path / "file"),
    ):
        pass
    assert "\n" not in str(caught.value)


NAMES = ("filtered", "unfiltered", "net", "net_tuned", "blind")
TOTALS = {name: {"post": {"ERR": 0.1, "frames": 100}} for name in NAMES}
EFFECTS = effects_of({(name, "post"): [3] * 12 for name in NAMES})
WRITTEN = facts_of(
    totals=TOTALS,
    claims={"filter_ERR": {"held": 2}},
    run={"output": {"save": "out.rrd"}, "evaluation": {"window": 7, "from_the_future": 1}},
    log=LogFacts("street.mcap", "abc"),
    effects=EFFECTS,
)


def changed(**parts):
    """The text of a summary with other parts, under the digest of the first ones."""
    return json.dumps(json.loads(WRITTEN.text()) | parts)


def sealed(content):
    digest = digest_of(content, content["digest"]["parts"])
    return json.dumps(content | {"digest": digest})


def test_what_is_read_is_what_was_written():
    assert Facts.parse(WRITTEN.text(), "here") == WRITTEN
    assert Facts.parse(WRITTEN.text(), "here").effects == EFFECTS


def test_undefined_numbers_are_null_and_read_as_undefined():
    (effect,) = (e for e in EFFECTS if (e.base, e.variant) == ("unfiltered", "filtered"))
    nothing = replace(effect.rates["ERR"], mean=math.nan, units=0)
    facts = replace(WRITTEN, effects=[replace(effect, rates={"ERR": nothing})])
    written = json.loads(facts.text())
    assert written["difference"]["post"]["ERR"]["mean"] is None
    (read,) = Facts.parse(facts.text(), "here").effects
    assert math.isnan(read.rates["ERR"].mean)
    assert replace(read.rates["ERR"], mean=0) == replace(nothing, mean=0)


def test_each_difference_is_under_what_is_subtracted_too():
    content = json.loads(WRITTEN.text())
    assert [*content["difference"]] == ["post"]
    parts = {part: [*content[f"against_{part}"]] for part in ("unfiltered", "blind", "method")}
    assert parts == {
        "unfiltered": ["net", "net_tuned"],
        "blind": ["filtered", "unfiltered", "net", "net_tuned"],
        "method": ["net_tuned"],
    }


@pytest.mark.parametrize("given", [{"confidence": 2}, {"window": None}, 5, None])
def test_damaged_settings_are_one_line(given):
    with pytest.raises(ResultsError, match=r"`run.evaluation` is not what it must be"):
        _ = facts_of(run={"evaluation": given}).evaluation


@pytest.mark.parametrize(
    ("summary", "told"),
    [
        (
            {"format": {**Facts.FORMAT, "version": 1}},
            "made by an earlier version of roadeval in a format",
        ),
        (
            {"format": {**Facts.FORMAT, "version": 2}, "versions": {"roadeval": "0.2.0"}},
            "made by roadeval 0.2.0 in a format",
        ),
        ({"format": {**Facts.FORMAT, "version": 99}}, "made by a later version: update roadeval"),
        ({"format": {**Facts.FORMAT, "version": "x"}}, "not of format roadeval-summary"),
        ([3], "not of format roadeval-summary"),
    ],
)
def test_a_summary_of_another_format_is_refused_with_who_wrote_it(summary, told):
    with pytest.raises(ResultsError) as caught:
        Facts.parse(json.dumps(summary), "old.rrd")
    assert str(caught.value).startswith(f"old.rrd: {told}")


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("totals", {"blind": 5}),
        ("totals", {"filtered": {"post": None}}),
        ("seconds", {"filtered": 1.5}),
        ("settings", -1),
        ("tables", {"frames": 1.5}),
        ("run", []),
        ("drive", {}),
        ("frames", {"evaluated": "many"}),
        ("difference", {"post": {"ERR": {"mean": "high"}}}),
        ("cameras", []),
        ("cameras", {"left": "no facts"}),
    ],
)
def test_a_part_of_another_shape_is_damage(part, value):
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        Facts.parse(changed(**{part: value}), "here")


@pytest.mark.parametrize("part", ["verdict", "frames", "totals", "difference"])
def test_a_part_that_is_not_there_is_named(part):
    content = json.loads(WRITTEN.text())
    del content[part]
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        Facts.parse(json.dumps(content), "here")


def test_a_number_that_was_changed_is_damage():
    other = {**TOTALS, "filtered": {"post": {"ERR": 0.3, "frames": 100}}}
    with pytest.raises(ResultsError, match=r"here: damaged \(its content is not what was"):
        Facts.parse(changed(totals=other), "here")
    content = json.loads(WRITTEN.text())
    del content["claims"]
    with pytest.raises(ResultsError, match="here: damaged"):
        Facts.parse(json.dumps(content), "here")


def test_where_files_lie_may_change():
    moved = Facts.parse(changed(run={"output": {"save": "elsewhere.rrd"}}), "here")
    assert moved.run["output"]["save"] == "elsewhere.rrd"


@pytest.mark.parametrize("digest", ["x", {}, {"parts": 5, "sha256": ""}, {"parts": [[]]}])
def test_a_damaged_digest_is_damage(digest):
    with pytest.raises(ResultsError, match="here: damaged"):
        Facts.parse(changed(digest=digest), "here")


def test_parts_that_a_later_version_covers_are_checked_by_this_one():
    content = json.loads(WRITTEN.text()) | {"new": [1, 2]}
    content["digest"]["parts"].append("new")
    assert Facts.parse(sealed(content), "here") == WRITTEN
    with pytest.raises(ResultsError, match="damaged"):
        Facts.parse(json.dumps(json.loads(sealed(content)) | {"new": [1, 3]}), "here")
