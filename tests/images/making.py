"""Small image files of every format."""

import io
import zlib
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from roadeval.data import Rgb

HEIGHT, WIDTH = 48, 72


def scene() -> Rgb:
    """Return an image with slopes and noise."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    image = np.dstack([3 * x, 255 - 3 * x, 4 * y]).astype(np.uint8)
    image[10:30, 20:50] = np.random.default_rng(0).integers(0, 256, (20, 30, 3))
    return image


def file(format_: str, image: npt.NDArray[Any] | None = None, **options: Any) -> bytes:
    """Return an image, by default the scene, as a file of one of Pillow's formats."""
    made = io.BytesIO()
    Image.fromarray(scene() if image is None else image).save(made, format_, **options)
    return made.getvalue()


def oriented(orientation: int) -> Image.Exif:
    """Return EXIF data that asks for a turn."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    return exif


EXACT: Final = {
    "PNG": file("PNG"),
    "WebP without loss": file("WEBP", lossless=True),
    "TIFF": file("TIFF", compression="tiff_lzw"),
    "BMP": file("BMP"),
    "PPM": file("PPM"),
}
LOSSY: Final = {
    "JPEG": file("JPEG", quality=90),
    "WebP": file("WEBP", quality=90),
    "AVIF": file("AVIF", quality=90),
    "JPEG 2000": file("JPEG2000"),
}


def by_opencv(data: bytes) -> Rgb:
    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), flags), np.uint8)


def jpeg_of_size(width: int, height: int) -> bytes:
    """Return a JPEG whose head claims a size."""
    data = bytearray(LOSSY["JPEG"])
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return bytes(data)


def png_of_size(width: int, height: int, data: bytes = EXACT["PNG"]) -> bytes:
    """Return a PNG whose head claims a size, under a checksum that is right."""
    head = b"IHDR" + width.to_bytes(4, "big") + height.to_bytes(4, "big") + data[24:29]
    return data[:12] + head + zlib.crc32(head).to_bytes(4, "big") + data[33:]


def zeroed(data: bytes, at: int, length: int = 40) -> bytes:
    """Return a file some bytes of which are zeros."""
    return data[:at] + bytes(length) + data[at + length :]
