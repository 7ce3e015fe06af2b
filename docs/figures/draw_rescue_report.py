"""Draw the picture of rescue-report.md: ``python docs/figures/draw_rescue_report.py runs/nist_6x4-0/report.html``.

The image shows the page as on a desktop screen and, next to it, as on a phone. Needs Debian's chromium, no screen.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

IMAGE = Path(__file__).parents[1] / "images" / "rescue-report.jpg"
HEIGHT = 1500
"""Height of the browser's windows, pixels."""


def main() -> None:
    """Draw the page named on the command line."""
    page = Path(sys.argv[1]).absolute()
    wide, narrow = in_browser(page, 1180, HEIGHT), in_browser(page, 500, HEIGHT)
    gap = np.full((HEIGHT, 24, 3), 150, np.uint8)
    picture = cv2.resize(np.hstack([wide, gap, narrow]), None, fx=0.62, fy=0.62, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(IMAGE), picture, [cv2.IMWRITE_JPEG_QUALITY, 80])


def in_browser(page: Path, width: int, height: int) -> NDArray[np.uint8]:
    """(height, width, 3) uint8 BGR screenshot of the page in a window of this size in pixels."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder, "picture.png")
        flags = ["--headless", "--no-sandbox", "--hide-scrollbars", f"--user-data-dir={folder}/profile"]
        size = [f"--window-size={width},{height}", f"--screenshot={picture}"]
        subprocess.run(["chromium", *flags, *size, page.as_uri()], check=True, stderr=subprocess.DEVNULL)
        return cv2.imread(str(picture))


if __name__ == "__main__":
    main()
