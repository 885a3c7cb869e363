"""The pictures of README.md and of the site: ``python docs/pictures.py`` takes them anew.

They show the demo drive in the viewer and on the page that ``roadeval report`` writes, in Chromium.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from playwright.sync_api import sync_playwright

import roadeval
from roadeval.recording import viewer

ROOT: Final = Path(__file__).resolve().parents[1]
EXAMPLE: Final = ROOT / "reports" / "example"
FRAME: Final = 64
"""A frame on which the filter mends what shade does to the mask."""
BAR: Final = 37
"""The height in pixels of the viewer's own bar, which tells about the machine."""
WIDTH: Final = 1440


def show_viewer(recording: Path, picture: Path) -> None:
    """Take a picture of the viewer at a frame."""
    screen = picture.with_suffix(".png")
    viewer.screenshot(recording, screen, FRAME)
    pixels = cv2.imread(str(screen))[BAR:]
    small = cv2.resize(pixels, None, fx=0.8333, fy=0.8333, interpolation=cv2.INTER_AREA)
    write_jpeg(picture, small, 78)


def show_page(recording: Path, picture: Path) -> None:
    """Take a picture of the page's head and of its film."""
    page = roadeval.write_report(recording, picture.with_suffix(".html"))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        tab = browser.new_page(viewport={"width": WIDTH, "height": 900}, color_scheme="light")
        tab.goto(page.resolve().as_uri())
        tab.wait_for_timeout(3000)  # until the film stands at the worst frame
        box = tab.locator(".ribbons").bounding_box()
        assert box
        clip = {"x": 0, "y": 0, "width": WIDTH, "height": box["y"] + box["height"] + 24}
        png = tab.screenshot(full_page=True, clip=clip)
        browser.close()
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    write_jpeg(picture, pixels, 72)


def write_jpeg(picture: Path, pixels: np.ndarray, quality: int) -> None:
    """Write an image of ``(H, W, 3)`` BGR into the project."""
    cv2.imwrite(str(EXAMPLE / picture.name), pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)  # Pages show commands with the path of their recording.
        demo = Path("demo.rrd")
        shutil.copy(ROOT / "recordings" / "demo.mcap", "demo.mcap")
        roadeval.replay("demo.mcap", save=demo, reports="demo")
        show_viewer(demo, Path("viewer.jpg"))
        show_page(demo, Path("page.jpg"))
        shutil.copy("demo/fig3b_fp_fn_rate.png", EXAMPLE)
