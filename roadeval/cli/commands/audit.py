"""``roadeval audit``: labels that look wrong."""

from __future__ import annotations

from pathlib import Path
from shlex import join, quote
from typing import TYPE_CHECKING, Annotated

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OptionValues, takes

if TYPE_CHECKING:
    from roadeval.jobs.results.audit import Audit


@takes(
    *("truth", "labels", "topics.truth", "topics.sync_tolerance_ms", "topics.resize_truth"),
    *("preset", "config", "variants", "nets", "masks", "topics.masks", "cameras", "run.jobs"),
)
def audit(
    source: Annotated[
        Path,
        arguments.argument(
            "DRIVE|RESULT", "A camera log (MCAP), which is replayed first, or a result of it."
        ),
    ],
    *,
    count: Annotated[
        int, arguments.option("-n --count", "Most labels to name.", "N", min=1, max=100_000)
    ] = 20,
    output: Annotated[
        Path | None, arguments.option("-o --output", "Folder for labels to correct.", "FOLDER")
    ] = None,
    form: arguments.LabelFormat = "png",
    annotators: Annotated[
        list[str] | None,
        arguments.option(
            "--annotator", "Masks that are another person's labels. Repeatable.", "NAME"
        ),
    ] = None,
    options: OptionValues,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Find labels that look wrong, and write them for correction.

        roadeval audit drive.mcap --truth labels/ -o to_check
        roadeval audit recordings/drive.rrd --annotator b

    A label looks wrong if it contradicts methods that are right elsewhere, or the labels before
    and after; if it has specks or holes; or if it fits better mirrored, moved, or on another
    frame. FOLDER/suspects shows these places, and FOLDER/proposals has the present labels; put the
    corrected labels into FOLDER/labels. 'replay --truth FOLDER' reads these instead of the drive's.
    """
    if options and (source.suffix == ".rrd" or (source / "summary.json").is_file()):
        raise typer.BadParameter(f"{source}: a result has its truth and masks; give the log")
    arguments.check_one_camera(options)
    from roadeval.jobs.results.audit import PRESET
    from roadeval.jobs.results.audit import audit as run
    from roadeval.results.facts import json_text, plain
    from roadeval.results.rows import records

    config = arguments.configuration(
        options if "config" in options else {"preset": PRESET, **options}
    )
    with progress.show(quiet) as watch:
        done = run(
            *(source, count, output, config),
            labels=form,
            annotators=annotators or (),
            on_progress=watch,
        )
    if json:
        about = {"labels": done.labels, "sentences": done.sentences}
        about["suspects"] = records(done.suspects)
        console.emit(json_text(plain(about)).rstrip())
    elif not quiet:
        _show(done, output)
    messages.warn_of_missing_loops()
    return ExitCode.DONE


def _show(done: Audit, output: Path | None) -> None:
    """Print the labels that look wrong, and what to do with them."""
    from roadeval.cli.screens.tables import show_table
    from roadeval.report.blocks import Table

    out = console.results()
    for sentence in done.sentences:
        console.say(sentence, out)
    if not len(done.suspects):
        return
    rows = done.suspects.astype(str)
    clear = rows["clear"].map({"True": "clearly", "False": "perhaps"})
    area = rows["left"] + "-" + rows["right"] + ", " + rows["top"] + "-" + rows["bottom"]
    cells = [*zip(rows["rank"], rows["frame"], clear, area, rows["why"], strict=True)]
    titles = ["", "frame", "wrong", "columns, rows", "why"]
    out.print()
    show_table(Table(titles, cells, text_columns=[2, 3, 4]), out)
    out.print()
    if output is None:
        out.print("-o FOLDER writes these labels for correction, with pictures.")
        return
    console.say(
        f"Look at {output}/suspects: road is green with a yellow edge, the area in doubt has an "
        f"orange box. Correct what is wrong in {output}/proposals, and put the "
        f"results into {output}/labels.",
        out,
    )
    config = f" --config {quote(str(done.config))}" if done.config else ""
    truth = f"--truth {quote(str(output))}"
    console.show_next(out, f"roadeval replay {join([done.log])}{config} {truth}")
