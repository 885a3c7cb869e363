"""``roadeval pick``: frames worth labelling."""

from __future__ import annotations

from pathlib import Path
from shlex import join, quote
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OptionValues, takes


@takes("preset", "config", "nets", "training.model", "cameras", "run.jobs")
def pick(
    sources: Annotated[
        list[Path],
        arguments.argument(
            "DRIVE|RESULT...",
            "Camera logs (MCAP), which are replayed first, results of them with their recordings, "
            "or a fleet's folder.",
        ),
    ],
    *,
    count: Annotated[
        int, arguments.option("-n --count", "Frames to label.", "N", min=1, max=100_000)
    ],
    output: Annotated[
        Path, arguments.option("-o --output", "Folder; an existing one is extended.", "FOLDER")
    ],
    form: arguments.LabelFormat = "png",
    variant: Annotated[
        str | None,
        arguments.option(
            "--by", "Variant that gives masks and uncertainty. Default: the first.", "NAME"
        ),
    ] = None,
    seed: Annotated[int, arguments.option("--seed", "Random seed.", "N", min=0)] = 0,
    options: OptionValues,
    quiet: arguments.Quiet = False,
) -> int:
    """Pick frames of a log without truth to label.

        roadeval pick drive.mcap -n 20 -o to_label

    Half of them are drawn at random along the drive; from these 'replay --truth FOLDER' estimates
    the rates of the whole drive, with an interval. The others are the most uncertain ones, apart
    from each other, to learn from. FOLDER/images has the images, FOLDER/proposals the present
    masks; put the corrected masks into FOLDER/labels. Picking again into the same folder adds
    frames. A log is replayed first, with the settings of --config; a result is used as it is.
    """
    arguments.check_one_camera(options)
    config = arguments.configuration(options)
    from roadeval.data.words import counted
    from roadeval.jobs.results.pick import pick as run
    from roadeval.logs.truth.picks import Why

    with progress.show(quiet) as watch:
        drives = run(
            *(sources, count, output, config),
            labels=form,
            variant=variant,
            seed=seed,
            on_progress=watch,
        )
    for drive in drives if not quiet else ():
        random = sum(frame.why is Why.RANDOM for frame in drive.added)
        ranked, by = len(drive.added) - random, drive.picks.method["ranked_by"]
        uncertain = f", {ranked} most in doubt (by {by})" if ranked else ""
        drawn = f"{random} drawn at random of {len(drive.picks.stamps):,}"
        added = counted(len(drive.added), "frame")
        console.say(f"{drive.folder}: {added} to label: {drawn}{uncertain}")
    if drives and not quiet:
        out = console.results()
        folder = drives[0].folder if len(drives) == 1 else output / "{drive}"
        out.print(f"Correct {folder}/proposals, and put the results into {folder}/labels.")
        logs, run_toml = join(drive.log for drive in drives), quote(str(drives[0].config))
        name, more = ("replay", "") if len(drives) == 1 else ("fleet", " -o labelled")
        truth = quote(str(folder))
        console.show_next(out, f"roadeval {name} {logs} --config {run_toml} --truth {truth}{more}")
    messages.warn_of_missing_loops()
    return ExitCode.DONE
