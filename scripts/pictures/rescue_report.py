"""Draw the picture for rescue-report.md: a run's report on a desktop screen and, next to it, on a phone screen.

This needs Debian's chromium, but no screen.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from scripts.pictures.layout import BACKGROUND, save, scaled

HEIGHT, WIDTHS, GAP = 1500, (1180, 420), 24
"""Height and widths of the two windows, and the gap between and around the windows, pixels."""
FACTOR = 0.66
WINDOWS = """<body style="margin:{gap}px;display:flex;gap:{gap}px;background:rgb{background}">{frames}</body>"""
WINDOW = """<iframe src="{page}" width="{width}" height="{height}" scrolling="no" style="border:0"></iframe>"""


def draw(folder: Path) -> None:
    """Draw the report of the run in a folder."""
    page = (folder / "report.html").resolve().as_uri()
    frames = "".join(WINDOW.format(page=page, width=width, height=HEIGHT) for width in WIDTHS)
    windows = WINDOWS.format(gap=GAP, background=BACKGROUND, frames=frames)
    size = sum(WIDTHS) + 3 * GAP, HEIGHT + 2 * GAP
    save("rescue-report.jpg", scaled(browser_screenshot(windows, *size), FACTOR), 82)


def browser_screenshot(html: str, width: int, height: int) -> Rgb:
    """(height, width, 3) screenshot of a page in a window of this size in pixels."""
    if (browser := shutil.which("chromium")) is None:
        raise InputError("chromium is missing; run: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        page, picture = Path(folder, "page.html"), Path(folder, "picture.png")
        page.write_text(html)
        flags = ["--headless", "--no-sandbox", "--hide-scrollbars", f"--user-data-dir={folder}/profile"]
        size = [f"--window-size={width},{height}", f"--screenshot={picture}"]
        subprocess.run([browser, *flags, *size, page.as_uri()], check=True, stderr=subprocess.DEVNULL)
        with Image.open(picture) as shot:
            return np.asarray(shot.convert("RGB"))
