"""Making a camera log of a folder of images, or of a video."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Final

from roadeval.images import ImageError, Limits, format_of, size_of, to_png
from roadeval.logs.errors import LogError
from roadeval.logs.files import IMAGES, images_of, listed, of_ids, ordered, some
from roadeval.logs.settings import NS
from roadeval.logs.writing.writer import LogWriter
from roadeval.runtime.files import check_input

CAMERA: Final = "/camera/image"
TRUTH: Final = "/truth/road"
DEFAULT_RATE_HZ: Final = 10.0
LABEL_DELAY_NS: Final = 1
"""A label is logged right after its image."""

VIDEO_SUFFIXES: Final = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".ts", ".mpg", ".mpeg")
QUALITY: Final = 95
"""JPEG quality of a video's frames, 0 to 100."""
GREATEST: Final = 1 << 30
"""Most pixels of an image that is converted."""


@dataclass(frozen=True, slots=True)
class PackResult:
    """The log that was written, and what a user should know of it."""

    path: Path
    frames: int
    labelled: int
    """Images, and how many of them have a mask."""
    stamps: str
    """Source of the stamps, in words."""
    warnings: tuple[str, ...] = ()
    """Images without a mask (if there are masks), and masks without an image."""


def pack(
    images: str | Path,
    output: str | Path,
    *,
    masks: str | Path | None = None,
    rate_hz: float | None = None,
) -> PackResult:
    """Write a folder of images, or a video, as a log that Foxglove and Rerun open too.

    JPEGs and PNGs go in as they are, a video's frames as JPEGs of quality 95. Masks belong to
    the image of the same name, endings such as ``_mask`` aside. The same files give the same
    bytes.

    Parameters
    ----------
    images
        A folder, taken in natural order (``2.png`` before ``10.png``), or a video file.
    output
        The log to write.
    masks
        A folder of label images without loss (PNG), for a folder of images.
    rate_hz
        Images a second. By default a video's own; of images, the times in their names if every
        name is a time (seconds, or milli-, micro- or nanoseconds since 1970), else 10.

    Raises
    ------
    LogError
        If there is nothing to pack, a file is unreadable, or no mask belongs to an image.
    """
    images, output = Path(images), Path(output)
    if rate_hz is not None and not 1e-4 <= rate_hz <= 1000:
        raise LogError(f"{rate_hz:g} images a second: must be at least 0.0001 and at most 1000")
    if images.suffix.lower() in VIDEO_SUFFIXES and images.is_file():
        if masks is not None:
            raise LogError(f"{images}: masks go with a folder of images, not with a video")
        count = 0
        with LogWriter(output) as log:
            for count, (time_ns, jpeg) in enumerate(_frames_of(images), start=1):
                if rate_hz is not None:
                    time_ns = round((count - 1) * NS / rate_hz)  # noqa: PLW2901
                log.image(CAMERA, time_ns, jpeg, "jpeg")
            if not count:
                raise LogError(f"{images}: a video without frames")
        words = "the video's own times" if rate_hz is None else f"{rate_hz:g} images a second"
        return PackResult(output, count, 0, words)
    if not images.is_dir():
        raise LogError(f"{images}: neither a folder of images nor a video")
    return _pack_folder(images, output, Path(masks) if masks else None, rate_hz)


def _pack_folder(
    images: Path, output: Path, masks: Path | None, rate_hz: float | None
) -> PackResult:
    files, labels = listed(images, IMAGES), _label_images(masks, images) if masks else []
    belong = images_of(labels, files)
    if labels and not belong:
        raise LogError(f"{masks}: no mask has the name of an image in {images} ({some(labels)})")
    by_image = {image: label for label, image in belong.items()}
    if len(by_image) < len(belong):
        extra = next(label for label in belong if by_image[belong[label]] != label)
        other = by_image[belong[extra]]
        raise LogError(f"{masks}: {extra.name} and {other.name} belong to the same image")
    stamps, words = _stamps(files, rate_hz)
    with LogWriter(output) as log:
        for file, stamp in stamps.items():
            log.image(CAMERA, stamp, *_image(file))
            if file in by_image:
                label = _image(by_image[file], is_label=True)
                log.image(TRUTH, stamp, *label, log_time_ns=stamp + LABEL_DELAY_NS)
    used = set(by_image.values())
    warnings = (
        *_unpaired("images without a mask", [f for f in files if labels and f not in by_image]),
        *_unpaired("masks without an image", [label for label in labels if label not in used]),
    )
    return PackResult(output, len(files), len(by_image), words, warnings)


def _label_images(masks: Path, images: Path) -> Sequence[Path]:
    try:
        if masks.resolve() == images.resolve():
            raise LogError(f"{masks}: the images themselves")
        return of_ids(listed(masks, IMAGES))
    except LogError as error:
        if not masks.exists():
            raise
        raise LogError(
            f"{error}; labels of an annotation tool are for the packed log: pack without them, "
            f"then roadeval replay LOG.mcap --truth {masks} --truth-images {images}"
        ) from error


def _unpaired(what: str, files: Sequence[Path]) -> Iterator[str]:
    """Yield a sentence that names some of the files, if there are any."""
    if files:
        yield f"{what}: {some(files)} ({len(files)} in all)"


def _stamps(files: list[Path], rate_hz: float | None) -> tuple[dict[Path, int], str]:
    """Return each file's stamp, in the order of the stamps, and their source in words."""
    in_order, times = ordered(files)
    if rate_hz is None and times is not None:
        return dict(zip(in_order, times, strict=True)), "the times in the files' names"
    rate = rate_hz or DEFAULT_RATE_HZ
    regular = {file: round(i * NS / rate) for i, file in enumerate(files)}
    return regular, f"{rate:g} images a second"


def _frames_of(video: Path) -> Iterator[tuple[int, bytes]]:
    """Yield each frame's time in nanoseconds after the first, and the frame as a JPEG.

    A `LogError` if it cannot be read, or holds no video.
    """
    import av
    import cv2

    try:
        with av.open(str(video)) as container:
            if not container.streams.video:
                raise LogError(f"{video}: it holds no video")
            stream = container.streams.video[0]
            first: int | None = None
            for index, frame in enumerate(container.decode(stream)):
                pts = index if frame.pts is None else frame.pts
                first = pts if first is None else first
                unit = stream.time_base or Fraction(1, 25)
                bgr = frame.to_ndarray(format="bgr24")
                _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                yield round((pts - first) * unit * NS), jpeg.tobytes()
    except (av.FFmpegError, OSError) as error:
        raise LogError(f"{video}: not a readable video ({error.strerror})") from error


def _image(file: Path, *, is_label: bool = False) -> tuple[bytes, str]:
    """Read an image file as it is, or as a PNG if viewers do not know its format.

    Whatever its ending; a label must not be a JPEG.
    """
    try:
        check_input(file)
        data = file.read_bytes()
        size_of(data)
        format_ = format_of(data)
        assert format_ is not None
        if is_label and not format_.exact:
            raise LogError(f"{file}: {format_.name} changes label values; masks must be lossless")
        if format_.media_type is None:
            return to_png(data, Limits(GREATEST)), "png"
        return data, format_.media_type.removeprefix("image/")
    except OSError as error:
        raise LogError(f"{file}: {error.strerror}") from error
    except ImageError as error:
        raise LogError(f"{file}: {error}") from error
