"""``roadeval pick``: frames worth labelling."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import join, quote
from typing import TYPE_CHECKING, Annotated, Literal

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import Given, takes

if TYPE_CHECKING:
    from roadeval.jobs.results.pick import Outcome


@takes("preset", "config", "nets", "training.model", "cameras", "run.jobs")
def pick(
    sources: Annotated[
        list[Path],
        arguments.argument(
            "DRIVE|RESULT",
            "Camera logs (MCAP), which are replayed first, results of them with their recordings, "
            "or a fleet's folder.",
        ),
    ],
    *,
    count: Annotated[
        int, arguments.option("-n --count", "Frames to label.", "N", min=1, max=100_000)
    ],
    output: Annotated[
        Path, arguments.option("-o --output", "Where they land, or go on.", "FOLDER")
    ],
    form: Annotated[
        Literal["png", "coco"],
        arguments.option("--format", "Of the present masks, which are to be corrected."),
    ] = "png",
    variant: Annotated[
        str | None, arguments.option("--by", "Whose masks and doubt. Default: the first.", "NAME")
    ] = None,
    seed: Annotated[int, arguments.option("--seed", "Of the drawing.", "N", min=0)] = 0,
    given: Given,
    quiet: arguments.Quiet = False,
) -> int:
    """Pick frames of a log without truth to label.

    Half of them are drawn at random along the drive: of these 'replay --truth FOLDER' makes a
    number for the whole drive, with its interval. The others are those most in doubt, apart from
    each other: to learn from. FOLDER/images has the images, FOLDER/proposals the present masks;
    corrected ones belong into FOLDER/labels. Picking again into the same folder goes on. How a log
    is replayed first is told by a --config of 'replay'; a result is taken as it is.
    """
    arguments.check_one_camera(given)
    config = arguments.configuration(given)
    from roadeval.data.words import counted
    from roadeval.jobs.results.pick import pick as run
    from roadeval.logs.truth.picks import Why

    with progress.watched(quiet) as watch:
        found = run(
            *(sources, count, output, config),
            labels=form,
            variant=variant,
            seed=seed,
            on_progress=watch,
        )
    for each in found if not quiet else ():
        random = sum(frame.why is Why.RANDOM for frame in each.added)
        ranked, by = len(each.added) - random, each.picks.method["ranked_by"]
        doubt = f", {ranked} most in doubt (by {by})" if ranked else ""
        of = f"{random} drawn at random of {len(each.picks.stamps):,}"
        console.emit(f"{each.folder}: {counted(len(each.added), 'frame')} to label: {of}{doubt}")
    if found and not quiet:
        out = console.results()
        out.print(f"Correct {found[0].folder}/proposals, and put the results into labels/.")
        console.show_next(out, _next(found, output))
    messages.loops_missing()
    return ExitCode.DONE


def _next(found: Sequence[Outcome], output: Path) -> str:
    """Return the command that scores the logs with their labels, in the way they were replayed."""
    logs, config = join(each.log for each in found), quote(str(found[0].config))
    if len(found) == 1:
        return f"roadeval replay {logs} --config {config} --truth {quote(str(found[0].folder))}"
    truth = quote(f"{output}/{{drive}}")
    return f"roadeval fleet {logs} --config {config} --truth {truth} -o labelled"
