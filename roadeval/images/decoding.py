"""Decoding of image files.

`simplejpeg` reports damage that other decoders fill in silently, and gives the same pixels as
OpenCV, bit for bit. Pillow reads all other formats, and checks a PNG's checksums first. Damage that
leaves a valid file cannot be found.

Images are turned by their EXIF orientation if the `Limits` say so.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from itertools import count
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.images.formats import ImageError, ImageFormat, Limits, format_of

Array = npt.NDArray[Any]
File = bytes | memoryview

_DEEP: Final = ("I;16", "I;16B", "I;16L", "I", "F")
"""Pillow's modes of images with one number of more than eight bits a pixel."""
_SCAN: Final = b"\xff\xda"
_TWELVE_BITS: Final = re.compile(rb"\xff[\xc0-\xc2]\x00[\x0b\x11]\x0c", re.DOTALL)
"""The head of a JPEG frame of one or three colours with 12 bits a sample."""
MOST_SCANS: Final = 100
"""Greatest number of scans of a JPEG, as in libtiff; encoders write about ten. A scan of a few
bytes can make the decoder walk through the image: 200 kB of scans would take over a minute."""


def to_rgb(data: File, limits: Limits, white: float | None = None) -> Rgb:
    """Decode an image file to ``(H, W, 3)`` uint8 RGB; `eight_bits` explains ``white``.

    Grey fills all channels, and opacity is left out. An `ImageError` if the file is damaged, of an
    unknown format, or too large.
    """
    image = _decode(data, limits)
    if isinstance(image, np.ndarray):
        pixels = image
    elif image.mode in _DEEP:
        pixels = np.repeat(eight_bits(_samples(image, data), white)[..., None], 3, axis=2)
    elif (deep := _deep_colours(data)) is not None:
        pixels = eight_bits(deep, white)
    else:
        pixels = np.array(image.convert("RGB"))
    return upright(pixels, _remaining_turn(data, limits))


def deep_samples(data: File, limits: Limits) -> Array | None:
    """Return samples of more than eight bits; None for other images. Errors as in `to_rgb`."""
    image = _decode(data, limits)
    is_grey = not isinstance(image, np.ndarray) and image.mode in _DEEP
    samples = _samples(image, data) if is_grey else _deep_colours(data)
    return None if samples is None or samples.dtype == np.uint8 else samples


def _deep_colours(data: File) -> Array | None:
    """Return the ``(H, W, 3)`` colours of a PNG of 16 bits; Pillow would keep eight.

    Grey with opacity fills all three. None for any other file. An `ImageError` if it is damaged.
    """
    import cv2

    # The bits of a sample, and the kind: colours, grey with opacity, colours with opacity.
    kinds = b"\x10\2", b"\x10\4", b"\x10\6"
    if _known_format(data).name != "PNG" or bytes(data[24:26]) not in kinds:
        return None
    colours: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if colours is None:
        raise ImageError("a damaged PNG (its colours of 16 bits cannot be decoded)")
    return np.ascontiguousarray(colours[..., 2::-1])


def to_labels(data: File, limits: Limits) -> Array:
    """Decode a label image to ``(H, W)`` numbers, or to ``(H, W, 3)`` if it has colours.

    A file with a palette gives its indices, or its greys if no entry has a colour. Three equal
    channels count as one. An image of a single colour that is transparent in parts gives its
    opacity. An `ImageError` as in `to_rgb`, or if one of several colours is transparent in parts,
    or the file can be read in two ways.
    """
    if _known_format(data).plugin == "Tiff":
        _check_tiff(data)
    return upright(_label_values(_decode(data, limits), data), _remaining_turn(data, limits))


_LOSSY_TIFF: Final = dict.fromkeys((6, 7), "JPEG") | {34712: "JPEG 2000", 50001: "WebP"}
"""Compressions of TIFF, by their numbers, that may change values."""


def lossy_format(data: File) -> str:
    """Return the name of a file's format if that changes values, as JPEG does; else empty."""
    if (format_ := format_of(data)) is None:
        return ""
    if format_.plugin == "Tiff":
        with suppress(Exception), _pillow_image(data, format_) as image:
            name = _LOSSY_TIFF.get(image.tag_v2.get(259))
            return f"TIFF of {name}" if name else ""
    return "" if format_.exact else format_.name


_REDUCED: Final = 1
"""Bit of the kind of a TIFF page: the image made smaller, such as a preview."""


def _check_tiff(data: File) -> None:
    """Raise an `ImageError` if a label in a TIFF file can be read in two ways, by its head."""
    format_ = _known_format(data)
    with _damage_in(format_), _pillow_image(data, format_) as image:
        tags = image.tag_v2
        if image.mode == "1" and tags.get(262) == 0 and str(tags.get(305)).startswith("tifffile"):
            raise ImageError(
                "a TIFF of one bit a pixel by tifffile, which writes True as black: save the mask "
                "with 8 bits, as uint8"
            )
        if (bands := tags.get(277, 1)) > len(image.getbands()):
            raise ImageError(f"a TIFF of {bands} bands: save the labels as one band")
        # Behind the last page, and at an opacity, Pillow raises one of these.
        with suppress(EOFError, SyntaxError):
            for place in count(1):
                image.seek(place)
                if not image.tag_v2.get(254, 0) & _REDUCED:
                    problem = "a TIFF of several images: save each label in a file of its own"
                    raise ImageError(problem)


def _label_values(image: Any, data: File) -> Array:
    if isinstance(image, np.ndarray):
        return without_colours(image)
    if image.mode == "P":
        indices = np.array(image)
        palette = np.array(image.getpalette("RGB"), np.uint8).reshape(-1, 3)
        # Unused colours count, too: images of one tool share a palette, and must be read alike.
        greys = (palette == palette[:, :1]).all() and indices.max() < len(palette)
        return np.ascontiguousarray(palette[indices, 0]) if greys else indices
    if image.mode in ("L", *_DEEP):
        return _samples(image, data)
    colours = np.array(image.convert("RGB"))
    opacity = np.array(image.getchannel("A")) if image.mode in {"RGBA", "LA"} else np.full(1, 255)
    clear = opacity < 128
    if clear.any() and not clear.all():
        packed = colours.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
        if packed.min() == packed.max():
            return opacity
        if np.intersect1d(packed[clear], packed[~clear]).size:
            raise ImageError(
                "a label image with one colour that is transparent in parts: save it without "
                "transparency"
            )
    deep = _deep_labels(image, data)
    return without_colours(colours) if deep is None else deep


def _deep_labels(image: Any, data: File) -> Array | None:
    """Return the ``(H, W)`` numbers of three equal channels of 16 bits.

    None if eight bits hold them. An `ImageError` if the channels differ.
    """
    import cv2

    deep: Any = _deep_colours(data)
    if image.format == "TIFF" and max(image.tag_v2.get(258, (8,))) > 8:
        deep = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if deep is None or deep.ndim != 3 or deep.dtype.itemsize < 2:
            raise ImageError("a TIFF with colours of more than 8 bits: save the labels with 8 bits")
    if deep is None:
        return None
    low, high = deep & 255, deep >> 8
    if not low.any() or np.array_equal(low, high):
        return None
    grey = without_colours(deep)
    if grey.ndim != 2:
        raise ImageError("a label image with colours that need 16 bits: save it with 8 bits")
    return grey


def palette_indices(data: File, limits: Limits) -> npt.NDArray[np.uint8]:
    """Return the ``(H, W)`` uint8 indices of a PNG; an `ImageError` if it has no palette."""
    image = _decode(data, limits)
    if isinstance(image, np.ndarray) or image.mode != "P":
        raise ImageError("an image without a palette")
    return np.array(image)


def palette_of(data: File) -> npt.NDArray[np.uint8] | None:
    """Return the ``(n, 3)`` colours of the values that `to_labels` gives of a PNG with a palette.

    These are those of its indices, or 256 greys if no entry has a colour. None for another file.
    """
    format_, place = format_of(data), 8  # behind the mark of a PNG
    if format_ is None or format_.name != "PNG" or bytes(data[25:26]) != b"\3":
        return None
    while place + 8 <= len(data) and (kind := bytes(data[place + 4 : place + 8])) != b"IDAT":
        length = int.from_bytes(data[place : place + 4], "big")
        if kind == b"PLTE":
            content = data[place + 8 : place + 8 + length // 3 * 3]
            colours = np.frombuffer(content, np.uint8).reshape(-1, 3)
            greys = np.repeat(np.arange(256, dtype=np.uint8), 3).reshape(-1, 3)
            return greys if (colours == colours[:, :1]).all() else colours
        place += 12 + length
    return None


def without_colours(image: Rgb) -> Array:
    """Return one channel of an image if its three channels are equal, else the image."""
    grey = image[..., 0]
    same = np.array_equal(grey, image[..., 1]) and np.array_equal(grey, image[..., 2])
    return np.ascontiguousarray(grey) if same else image


def whole_numbers(samples: Array) -> Array:
    """Return numbers as integers: unchanged if all are whole, else fractions as levels 0..255."""
    if samples.dtype.kind != "f":
        return samples
    is_whole = np.isfinite(samples) & (samples == np.rint(samples)) & (np.abs(samples) < 1 << 16)
    if not is_whole.all():
        return eight_bits(samples)
    return samples.astype(np.int32 if samples.min() < 0 else np.uint16)


def eight_bits(samples: Array, white: float | None = None) -> npt.NDArray[np.uint8]:
    """Convert samples of more than eight bits to 0..255, their upper eight bits.

    ``white`` is the sample that becomes 255: by default the greatest of 16 bits, or 1 for floats.
    """
    if samples.dtype.kind == "f":
        scale = np.float32(1 if white is None else 1 / white)
        samples = np.rint(np.clip(np.nan_to_num(samples) * scale, 0, 1) * 255)
    elif samples.dtype != np.uint8:
        scale = np.float32(256 / ((white or np.iinfo(np.uint16).max) + 1))
        samples = np.clip(samples * scale, 0, 255)
    return np.asarray(samples, np.uint8)


def _known_format(data: File) -> ImageFormat:
    format_ = format_of(data)
    if format_ is None:
        raise ImageError(f"{len(data)} bytes that are not an image of a known format")
    return format_


def size_of(data: File, limits: Limits) -> tuple[int, int]:
    """Return width and height of an image file by its head; errors as in `to_rgb`."""
    format_ = _known_format(data)
    if format_.plugin is None:
        width, height = _jpeg_size(data)
    else:
        with _damage_in(format_), _pillow_image(data, format_) as image:
            width, height = image.size
    return (height, width) if ORIENTATIONS[_remaining_turn(data, limits)][0] else (width, height)


ORIENTATIONS: Final = {
    1: (0, 0, 0),
    2: (0, 0, 1),
    3: (0, 1, 1),
    4: (0, 1, 0),
    5: (1, 0, 0),
    6: (1, 0, 1),
    7: (1, 1, 1),
    8: (1, 1, 0),
}
"""The turn of an image by EXIF's number: whether rows and columns are exchanged, whether the rows
then run backwards, and whether the columns do."""
_MARK_OF_JPEG: Final = b"Exif\0\0"
_MARKS_OF_TIFF: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_MARKS: Final = (_MARK_OF_JPEG, b"eXIf", b"EXIF", b"irot", b"imir", *_MARKS_OF_TIFF)
"""Every file with an orientation contains one of these, a JPEG the first."""


def upright(pixels: Array, orientation: int) -> Array:
    """Return an image, or a label image, turned by an EXIF orientation."""
    exchanged, rows, columns = ORIENTATIONS[orientation]
    turned = pixels.swapaxes(0, 1) if exchanged else pixels
    return np.ascontiguousarray(turned[:: 1 - 2 * rows, :: 1 - 2 * columns])


def orientation_of(data: File) -> int:
    """Return the EXIF orientation of an image file, 1 to 8; 1 if it has none."""
    content, format_ = bytes(data), format_of(data)
    if format_ and any(m in content for m in (_MARKS if format_.plugin else [_MARK_OF_JPEG])):
        plugin = format_.plugin or "Jpeg"
        with suppress(Exception), _pillow_image(data, format_._replace(plugin=plugin)) as image:
            orientation = image.getexif().get(0x0112)
            return orientation if orientation in ORIENTATIONS else 1
    return 1


def _remaining_turn(data: File, limits: Limits) -> int:
    """Return the orientation by which to turn a decoded image; Pillow itself turns a TIFF."""
    format_ = format_of(data)
    if (format_ is not None and format_.plugin == "Tiff") is limits.turn:
        return 1
    orientation = orientation_of(data)
    return orientation if limits.turn else {6: 8, 8: 6}.get(orientation, orientation)


def _jpeg_size(data: File) -> tuple[int, int]:
    import simplejpeg

    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
    except (ValueError, KeyError) as error:  # an unknown subsampling is a KeyError
        what = "a JPEG with a damaged head or a rare chroma subsampling"
        raise _jpeg_error(data, what) from error
    return width, height


def _jpeg_error(data: File, what: str) -> ImageError:
    is_deep = _TWELVE_BITS.search(data) is not None
    return ImageError("a JPEG of 12 bits a sample, which is not read: log PNG" if is_deep else what)


def _decode(data: File, limits: Limits) -> Any:
    """Return the pixels of a JPEG, or the loaded Pillow image of any other format."""
    format_ = _known_format(data)
    if format_.plugin is None:
        import simplejpeg

        limits.check(*_jpeg_size(data))
        if bytes(data).count(_SCAN) > MOST_SCANS:
            problem = f"a JPEG of more than {MOST_SCANS} scans, which takes too long to decode"
            raise ImageError(problem)
        try:
            return simplejpeg.decode_jpeg(data, "RGB", strict=True)
        except ValueError as error:
            raise _jpeg_error(data, f"a damaged JPEG ({error})") from error
    with _damage_in(format_):
        with _pillow_image(data, format_) as image:
            limits.check(*image.size)
            image.verify()
        with _pillow_image(data, format_) as image:
            image.load()
            return image


def _pillow_image(data: File, format_: ImageFormat) -> Any:
    """Return an image of Pillow, which has read only its head."""
    _silence_pillow()
    module = import_module(f"PIL.{format_.plugin}ImagePlugin")
    return getattr(module, f"{format_.plugin}ImageFile")(io.BytesIO(data))


@cache
def _silence_pillow() -> None:
    """Keep Pillow and libtiff from printing: their exceptions are reported with the frame.

    libtiff prints until its handler is removed; a libtiff in a separate library keeps printing.
    """
    import ctypes
    import warnings

    from PIL import _imaging

    warnings.filterwarnings("ignore", module=r"PIL\.")
    with suppress(OSError, AttributeError):
        ctypes.CDLL(_imaging.__file__).TIFFSetErrorHandler(None)


@contextmanager
def _damage_in(format_: ImageFormat) -> Iterator[None]:
    """Turn Pillow's exceptions on a damaged file into an `ImageError`."""
    try:
        yield
    except (ImageError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        if format_.plugin == "Tiff" and "unknown pixel mode" in reason:
            problem = (
                "a TIFF of numbers that are not read, as 64 bits: save one band of 8 or 16 bits"
            )
            raise ImageError(problem) from error
        raise ImageError(f"a damaged {format_.name} ({reason})") from error


def _samples(image: Any, data: File) -> Array:
    """Return the numbers of an image as its file has them, in this machine's byte order."""
    import cv2

    samples = np.array(image)
    if image.format in ("PPM", "JPEG2000"):  # Pillow scales them to 8 or 16 bits
        stored: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        samples = samples if stored is None else stored
    # Pillow holds samples of 16 bits in 32 bits for some formats.
    if samples.dtype == np.int32 and 0 <= samples.min() <= samples.max() < 1 << 16:
        samples = samples.astype(np.uint16)
    return samples.astype(samples.dtype.newbyteorder("="), copy=False)


def png_of(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Encode an ``(H, W)`` grey, ``(H, W, 3)`` RGB or ``(H, W, 4)`` RGBA image of uint8 as PNG."""
    import cv2

    codes = {3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
    stored = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, codes[pixels.shape[2]])
    return cv2.imencode(".png", stored)[1].tobytes()
