"""The results folder: what is written is what is read, and nothing half-done is left."""

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
from roadeval.results.facts import Facts, FrameAccount
from roadeval.results.folder import ResultsFolder, ResultsWriter, names_of_results
from roadeval.results.schema import OF_A_DRIVE as ALL_TABLES
from roadeval.results.tables import ResultsError
from tests.evaluation.making import a_frame, a_variant, pixels
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
        result = board.score(a_frame(truth, number + 5), role, (variant,))
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
    path.write_text(path.read_text().replace("filtered,0,0,1,3", "filtered,0,0,1,4"))
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
