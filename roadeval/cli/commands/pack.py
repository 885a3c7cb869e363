"""``roadeval pack``: a folder of images, or a video, becomes a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode


def pack(
    images: Annotated[
        Path,
        typer.Argument(
            metavar="IMAGES",
            show_default=False,
            help="A folder of images, or a video file.",
            readable=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DRIVE.mcap", help="Where the log lands.", readable=False
        ),
    ],
    *,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth", metavar="MASKS", help="A folder of masks, paired by name.", readable=False
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Images a second. Default: the times in the names, a video's own, or 10.",
        ),
    ] = None,
    quiet: arguments.Quiet = False,
) -> int:
    """Make a log of a folder of images or a video.

    Foxglove and Rerun open it too: JPEGs as they are, masks as PNG, Foxglove's protobuf schemas.
    """
    from roadeval.jobs.log_files import pack as run

    packed = run(images, output, truth=truth, rate_hz=rate)
    for warning in packed.warnings:
        messages.warning(warning)
    if not quiet:
        masks = f", {packed.labelled} with a mask" if truth else ""
        console.emit(f"{packed.path}: {packed.frames} images{masks}; {packed.stamps}")
    return ExitCode.DONE


COMMAND: Final = pack
