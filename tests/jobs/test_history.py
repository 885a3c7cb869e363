"""Histories of many results: read in their order, judged, and written."""

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from roadeval import Result, RoadevalError, compare, history
from roadeval.cli.commands.compare import compare as compare_command
from roadeval.cli.commands.history import history as history_command
from roadeval.cli.exit_codes import ExitCode
from roadeval.jobs.results.history import find_results, write
from roadeval.report.blocks import Figure, Heading
from roadeval.report.history import document, markdown
from roadeval.results.history import group_changes, verdict
from roadeval.results.tables import ResultsError, read_parquet, read_table, write_parquet
from tests.fleet.serving import Server
from tests.results.fleet.making import SCORED, UNSCORED, fleet_of

DAY = 86_400


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Eight runs of six drives; from the sixth on two drives are worse."""
    folder = tmp_path_factory.mktemp("history") / "nights"
    for night in range(8):
        made = folder / f"{night}"
        if night in (0, 5):
            fleet_of(made, 6, change=0.03 * (night >= 5), status=lambda _: SCORED)
        else:
            shutil.copytree(folder / f"{0 if night < 5 else 5}", made)
        summary = made / "fleet.json"
        content = json.loads(summary.read_text())
        origin = {"made_ns": (1000 + night) * DAY * 10**9, "commit": f"{night}" * 40}
        content["origin"] = origin | {"dirty": False, "labels": {"build": f"{night // 2}"}}
        content["run"]["svm"] = {"C": 1.0 + (night >= 5)}
        summary.write_text(json.dumps(content))
    return folder


def copy_sums(nights, folder):
    """Copy the runs without what lies apart for each drive."""
    apart = ("results", "frames", "regions", "worst", "scores", "classes")
    return shutil.copytree(nights, folder, ignore=shutil.ignore_patterns(*apart))


@pytest.fixture(scope="module")
def made(nights):
    return history(nights)


def test_the_run_that_is_worse_is_named_with_what_changed(made):
    (event,) = made.events
    assert event.run == 5
    line = event.first.line
    assert {len(part.drives) for part in made.lines if part.kind == "weather"} == {2}
    assert (line.variant, line.stage, line.kind, line.rate) == ("filtered", "post", "all", "ERR")
    assert sorted(event.first.drives["drive"][:2]) == ["drive_0000-00000000", "drive_0003-00000003"]
    assert event.reasons == ["commit 444444444444 to 555555555555", "svm.C 1 to 2"]
    assert {drive for drive, _, _ in event.frames} == set(event.first.drives["drive"][:2])
    assert [run.title for run in made.runs][::7] == ["1972-09-27", "1972-10-04"]
    assert "in the run of 1972-10-02 (55555555), on 2 of 6 drives" in verdict(made)


def test_drives_and_fleets_are_read_in_batches_with_the_rates_that_their_tables_hold(
    nights, monkeypatch
):
    monkeypatch.setattr("roadeval.jobs.results.history.BATCH", 3)
    drive = next((nights / "7" / "results").glob("drive_0003*/"))
    made = history([*(nights / f"{night}" for night in range(8)), drive])
    assert {line.variant for line in made.lines} == {"filtered", "unfiltered"}
    lines = [line for line in made.lines if (line.variant, line.rate) == ("filtered", "ERR")]
    assert {line.kind for line in lines} == {"all", "region", "weather", "place"}
    (everywhere,) = (line for line in lines if line.kind == "all")
    for run, path in enumerate([*(nights / f"{night}" for night in range(8)), drive]):
        scores = Result(path).scores
        scores = scores[scores["final"] & (scores["variant"] == "filtered")]
        for line in lines:
            part = line.part if line.kind == "region" else "all"
            rates = scores[scores["region"] == part].set_index("drive")["ERR"]
            has_tags = run < 8 or line.kind in ("all", "region")
            names = rates.index.astype(str) + "-00000003" * (run == 8)  # as in the fleets
            there = names.isin(line.drives["drive"]) & has_tags
            of_run = line.drive_rates[run][np.isfinite(line.drive_rates[run])]
            np.testing.assert_array_equal(sorted(of_run), sorted(rates[there]))
    assert np.isfinite(everywhere.drive_rates).sum(axis=1).tolist() == [6] * 8 + [1]


def test_near_steps_are_one_event_if_runs_are_noisy(made):
    change = made.events[0].first
    steps = [change.step._replace(run=run) for run in (4, 6, 7)]
    steps.append(change.step._replace(run=5, kind="outlier"))
    for noise, events in ((1e-3, [(4, 2), (5, 1), (7, 1)]), (0, [(n, 1) for n in (4, 5, 6, 7)])):
        line = change.line._replace(noise=noise)
        grouped = group_changes([change._replace(line=line, step=s) for s in steps], "filtered")
        assert [(event.run, len(event.changes)) for event in grouped] == events


def test_the_greatest_change_of_all_pixels_of_the_focus_stands_first(made):
    first = made.events[0].first
    fall = first._replace(difference=replace(first.difference, mean=-0.5))
    others = (fall.line._replace(**{name: "x"}) for name in ("variant", "kind", "rate"))
    changes = [first, fall, *(fall._replace(line=line) for line in others)]
    (event,) = group_changes(changes, "filtered")
    assert [change.difference.mean for change in event.changes][:2] == [-0.5, first.difference.mean]


def test_results_that_share_a_label_are_one_run(nights):
    made = history(nights, by="build")
    runs = [(run.title, len(run.paths), run.drives) for run in made.runs]
    assert runs == [(f"{build}", 2, 6) for build in range(4)]
    # Of a drive that a run has twice the later result counts.
    assert ([event.run for event in made.events], made.lost) == ([2], [])


def test_a_result_of_another_format_and_a_damaged_one_are_told(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    old = folder / "2" / "fleet.json"
    old.write_text(old.read_text().replace('"version": 3', '"version": 2', 1))
    (folder / "3" / "scores.parquet").write_bytes(b"PAR1")
    (folder / "4" / "drives.parquet").unlink()
    made = history(folder)
    assert [run.drives for run in made.runs] == [6, 6, 0, 0, 6, 6, 6]
    (event,) = made.events
    assert (event.run, event.before) == (4, 1)
    assert event.reasons[0] == "commit 111111111111 to 555555555555"
    assert len(made.lost) == 3
    assert "in a format that is no longer read" in made.lost[0]
    assert "scores.parquet: damaged" in made.lost[1]


def test_results_are_read_in_parts_and_those_of_a_drive_as_fleets(nights, made, monkeypatch):
    monkeypatch.setattr("roadeval.jobs.results.history.BATCH", 2)
    for line, other in zip(made.lines, history(nights).lines, strict=True):
        np.testing.assert_array_equal(line.drive_rates, other.drive_rates)
    folders = [nights / f"{night}" / "results" / "drive_0003-00000003" for night in (0, 5)]
    of_drive = history([nights / "1", *folders])
    (line,) = (line for line in of_drive.lines if line[:5] == made.lines[0][:5])
    is_drive = made.lines[0].drives["drive"] == folders[0].name
    rates = line.drive_rates[1:, line.drives["drive"] == folders[0].name]
    np.testing.assert_array_equal(rates, made.lines[0].drive_rates[[0, 5]][:, is_drive])


def test_a_drive_alone_is_the_drive_of_a_fleet_with_its_log(nights, tmp_path):
    name = "drive_0003-00000003"
    alone = shutil.copytree(nights / "5" / "results" / name, tmp_path / "alone")
    summary = json.loads((alone / "summary.json").read_text())
    summary["run"]["svm"] = {"C": 3}
    (alone / "summary.json").write_text(json.dumps(summary))
    (event,) = history([nights / "1", nights / "2", alone]).events
    assert event.run == 2
    assert "svm.C 1 to 3" in event.reasons
    assert not [reason for reason in event.reasons if reason.startswith("new drives")]
    assert {drive for drive, _, _ in event.frames} == {name}


def test_pixels_of_classes_are_lines_beside_those_of_regions(nights, tmp_path):
    folder, names = copy_sums(nights, tmp_path / "nights"), read_table("classes", "").columns
    rows = [("filtered", 1, "lit", "other", 2), ("filtered", 2, "street", "road", 6)]
    rows += [("filtered", n, "", "other", n) for n in (7, 8)] + [("blind", *rows[0][1:])]
    columns = ["variant", "class", "name", "truth", "road"]
    table = pd.DataFrame([*rows, ("filtered", 3, "sky", "ignored", 5)], columns=columns)
    table = table.assign(drive="drive_0000-00000000", camera="/camera/image", pixels=10)
    for night in range(8):
        path = folder / f"{night}" / "classes.parquet"
        write_parquet({path: ("classes", table.reindex(columns=names, fill_value=1))})
    path.unlink()
    made = history(folder)
    classes = {line.part: line.rates[0] for line in made.lines if line.kind == "class"}
    assert classes == pytest.approx({"lit": 0.2, "street": 0.4, "class 7": 0.7, "class 8": 0.8})
    assert made.lost == []
    assert {line.variant for line in made.lines} == {"filtered", "unfiltered"}
    assert len(history(folder, by="build").lines) == len(made.lines)


def test_two_logs_of_one_name_in_a_run_are_told(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    shutil.copytree(folder / "7", folder / "8")
    path = folder / "8" / "drives.parquet"
    table = read_parquet([path], "drives").assign(log_digest="another")
    write_parquet({path: ("drives", table)})
    made = history(folder, by="build")
    assert len(made.lost) == 6
    assert "two logs of a run are called drive_0000-00000000" in made.lost[0]


def test_recordings_and_folders_of_one_run_are_not_taken_twice(nights, tmp_path):
    folder = shutil.copytree(nights / "0", tmp_path / "all" / "0").parent
    (folder / "0.rrd").write_bytes(b"a recording of the same run")
    assert find_results(folder) == [folder / "0"]
    shutil.rmtree(folder / "0")
    assert find_results(folder) == [folder / "0.rrd"]
    (folder / "0.rrd").unlink()
    with pytest.raises(RoadevalError, match="holds no results"):
        find_results(folder)


def test_a_drive_that_has_gone_and_classes_are_told(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    for name in ("scores", "drives"):
        path = folder / "7" / f"{name}.parquet"
        rows = read_parquet([path], name)
        rows = rows[rows["drive"] != "drive_0005-00000005"]
        if name == "scores":
            rows["ERR"] += 0.05
        write_parquet({path: (name, rows)})
    event = history(folder).events[-1]
    assert event.run == 7
    assert "drives that are gone: drive_0005-00000005" in event.reasons


@pytest.mark.parametrize("end", ["html", "pdf", "md", "json"])
def test_every_kind_of_file_tells_the_same(end, made, tmp_path):
    path = write(made, tmp_path / f"history.{end}")
    if end != "pdf":
        text = path.read_text()
        assert "rose by 1.24 points" in text
        assert str(made.runs[3].paths[0]) in text


def test_the_base_of_a_comparison_is_the_last_good_run_of_a_folder(made, nights):
    assert made.last_good.paths == (str(nights / "4"),)
    compared = compare([nights, nights / "7"])
    assert [result.label for result in compared.comparison.results] == ["4", "7"]
    assert compared.content["changed"]


def test_markdown_has_no_heading_of_charts(made):
    assert "Over the runs" not in markdown(made)
    assert "Over the runs" in [b.text for b in document(made).blocks if isinstance(b, Heading)]


def test_a_run_that_cannot_be_read_is_told_where_the_folder_is_the_base(nights, tmp_path):
    folder = shutil.copytree(nights, tmp_path / "nights")
    (folder / "2" / "fleet.json").write_text("{")
    warnings = compare([folder, folder / "7"]).comparison.warnings
    assert len([text for text in warnings if str(folder / "2" / "fleet.json") in text]) == 1


def test_a_place_without_results_does_not_end_a_history(nights, tmp_path):
    with Server() as server:
        made = history([nights, tmp_path, server.url("404/night.zip")])
    assert len(made.runs) == 8
    of_folder, of_url = made.lost
    assert of_folder.startswith(str(tmp_path))
    assert server.url("404/night.zip") in of_url


def test_the_one_run_that_can_be_read_is_the_base_and_the_other_is_told(nights, tmp_path, capsys):
    folder = copy_sums(nights, tmp_path / "nights")
    for night in ("0", *"23456"):
        shutil.rmtree(folder / night)
    (folder / "1" / "fleet.json").write_text("{")
    shutil.copytree(nights / "7", folder / "7", dirs_exist_ok=True)
    compared = compare([folder, nights / "0"])
    assert [result.label for result in compared.comparison.results] == ["7", "0"]
    (warning,) = compared.comparison.warnings
    assert warning.startswith(str(folder / "1" / "fleet.json"))
    # Nothing of the compared results is lost.
    words = [str(folder), str(nights / "0")]
    assert compare_command(words, quiet=True) == ExitCode.DONE
    assert capsys.readouterr().err == f"roadeval: warning: {warning}\n"
    (folder / "7" / "fleet.json").write_text("{")
    with pytest.raises(RoadevalError, match=r"no run of it can be read; .*1/fleet.json"):
        compare([folder, nights / "0"])


def test_a_baseline_without_results_is_told_in_a_line(nights, tmp_path):
    with pytest.raises(RoadevalError) as failure:
        compare([tmp_path, nights / "7"])
    assert (failure.value.where, failure.value.problem) == (str(tmp_path), "holds no results")


@pytest.mark.sweep
def test_places_are_listed_once(nights, monkeypatch):
    walked = []
    monkeypatch.setattr("os.walk", lambda path, walk=os.walk: walked.append(path) or walk(path))
    assert history_command([str(nights)], quiet=True) == ExitCode.DONE
    assert compare_command([str(nights), str(nights / "7")], quiet=True) == ExitCode.DONE
    assert walked == [nights, nights]


@pytest.mark.parametrize(
    ("name", "column", "value"),
    [("scores", "ERR", np.inf), ("scores", "pooled_FPR", -0.1), ("scores", "TP", -1)],
)
def test_a_number_that_is_none_is_told_as_damage(name, column, value, nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    path = folder / "3" / f"{name}.parquet"
    rows = read_parquet([path], name)
    rows.loc[0, column] = value
    write_parquet({path: (name, rows)})
    with pytest.raises(ResultsError, match=f"damaged .column {column} holds {value}"):
        read_parquet([path], name)
    if column != "pooled_FPR":  # which a history does not read
        made = history(folder)
        assert [f"{path}: damaged" in text for text in made.lost] == [True]
        assert [run.drives for run in made.runs] == [6, 6, 6, 0, 6, 6, 6, 6]


def test_a_table_of_drives_without_rows_is_told_as_damage(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    path = folder / "3" / "drives.parquet"
    write_parquet({path: ("drives", read_parquet([path], "drives").iloc[:0])})
    assert history(folder).lost == [
        f"{path}: damaged (it has no rows); run the fleet's command again"
    ]


def test_runs_of_one_second_have_titles_of_their_own(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    for night in range(8):
        path = folder / f"{night}" / "fleet.json"
        content = json.loads(path.read_text())
        content["origin"]["made_ns"] = 1000 * DAY * 10**9 + night // 3
        path.write_text(json.dumps(content))
    titles = [run.title for run in history(folder).runs]
    first = "1972-09-27 00:00:00"
    assert titles == [first, *(f"{first} ({number})" for number in range(2, 9))]


def test_a_folder_of_runs_is_not_compared_with_itself(nights):
    with pytest.raises(RoadevalError) as failure:
        compare([nights])
    assert (failure.value.where, failure.value.problem) == (str(nights), "holds 8 results")


def test_a_last_run_without_numbers_neither_undoes_a_step_nor_is_good(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    (folder / "7" / "scores.parquet").write_bytes(b"PAR1")
    made = history(folder, fail_if=["post.filtered.ERR > +1pp"])
    assert verdict(made).endswith("No later run has undone it.")
    assert made.last_good.paths == (str(folder / "4"),)
    assert made.judgements[0].why.endswith("there are none")
    assert replace(made, events=[]).last_good.paths == (str(folder / "6"),)
    shutil.rmtree(folder / "7")
    fleet_of(folder / "7", 6, status=lambda _: UNSCORED)
    assert verdict(history(folder)) == verdict(made)


def test_the_place_that_changed_most_is_one_that_changed_in_the_same_direction(made):
    (event,) = made.events

    def part(name, mean):
        line = event.first.line._replace(kind="region", part=name, title=f"ERR, {name}")
        return event.first._replace(
            line=line, difference=replace(event.first.difference, mean=mean)
        )

    changes = [event.first, part("near the edge", 0.4), part("in light", -0.9)]
    told = verdict(replace(made, events=[replace(event, changes=changes)]))
    assert "; most of all: near the edge (+40.00). Changed in that run: commit" in told


def test_whether_a_rise_stands_is_no_matter_of_the_last_run_alone(made):
    (event,) = made.events
    line = event.first.line
    noisy = line._replace(levels=line.levels - 0.02 * (np.arange(8) == 7))
    change = event.first._replace(line=noisy)
    assert replace(made, events=[replace(event, changes=[change])]).last_good == made.runs[4]


def test_two_runs_that_differ_are_not_called_equal(nights):
    assert "chance" in verdict(history([nights / "4", nights / "5"]))


def test_times_that_are_none_put_a_run_first_or_last(nights, tmp_path):
    folder = copy_sums(nights, tmp_path / "nights")
    for night, made_ns in (("2", -(10**30)), ("3", 10**30)):
        summary = folder / night / "fleet.json"
        content = json.loads(summary.read_text())
        content["origin"]["made_ns"] = made_ns
        summary.write_text(json.dumps(content))
    runs = history(folder).runs
    assert [run.title[:4] for run in (runs[0], runs[-1])] == ["1970", "2262"]
    assert [run.origin.commit[0] for run in runs] == [*"20145673"]


def test_the_mark_of_a_step_lies_over_its_line(made):
    figure = next(block for block in document(made).blocks if isinstance(block, Figure))
    # Charts draw their first series last.
    names = [series.name for series in figure.charts[0].series]
    assert names.index("step of filtered, 1972-10-02") < names.index("filtered")
