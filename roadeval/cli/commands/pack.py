"""``roadeval pack``: a folder of images, or a video, becomes a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages


def pack(
    images: Annotated[Path, arguments.argument("IMAGES", "Images, a video, or kitti/training.")],
    output: arguments.NewLog,
    *,
    truth: Annotated[
        Path | None, arguments.option("--truth", "Folder of masks, paired by name.", "MASKS")
    ] = None,
    rate: Annotated[
        float | None,
        arguments.option(
            "--rate",
            "Images per second. Default: the times in the names, the rate of the video, or 10.",
            "HZ",
        ),
    ] = None,
    quiet: arguments.Quiet = False,
) -> int:
    """Make a log of images, a video, or KITTI's road benchmark.

        roadeval pack images/ --truth masks/ -o drive.mcap

    Foxglove and Rerun open the log, too. JPEGs are copied, masks become PNGs, and the messages
    have Foxglove's protobuf schemas.
    """
    from roadeval.jobs.log_files import pack as run

    packed = run(images, output, truth=truth, rate_hz=rate)
    messages.warning(*packed.warnings)
    if not quiet:
        masks = f", {packed.labelled} with a mask" if packed.labelled else ""
        console.say(f"{packed.path}: {packed.frames} images{masks}; {packed.stamps}")
    return messages.losses(packed.losses)
