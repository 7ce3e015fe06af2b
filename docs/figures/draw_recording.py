"""Draw the pictures of viewer.md: ``python docs/figures/draw_recording.py runs/nist_6x4-0/episode.rrd``.

Needs no screen, but Debian's xvfb and mesa-vulkan-drivers; the browser's image also needs Debian's chromium, and
Playwright in the Python that runs this script.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from pipeline.rerun.blueprint import blueprint
from pipeline.rerun.viewer import HOST, Viewer

IMAGES = Path(__file__).parents[1] / "images"
SIZE = (1400, 900)
MAP = (slice(36, 660), slice(0, 1048))
"""Rows and columns of the map in the window."""

BROWSER_FLAGS = [
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"
]  # fmt: skip
LOADING_TIME = 60
"""s until the screenshot is taken; the page loads slowly, because it is rendered without a GPU."""


def main() -> None:
    """Draw all pictures of the recording that the command names."""
    recording = Path(sys.argv[1])
    semantic, metric, segments, localisation = (in_window(recording, tab) for tab in (0, 1, 2, 4))
    save("recording-native.jpg", semantic)
    tabs = np.hstack([metric[MAP], segments[MAP]])
    save("recording-tabs.jpg", cv2.resize(tabs, None, fx=0.65, fy=0.65, interpolation=cv2.INTER_AREA))
    save("recording-localisation.jpg", localisation[MAP])
    save("recording-web.jpg", in_browser(recording))


def in_window(recording: Path, tab: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR, the native viewer with one of the map's tabs in front."""
    with tempfile.TemporaryDirectory() as folder:
        layout, picture = at_the_end(recording, tab, Path(folder)), Path(folder, "picture.png")
        # On so large a screen, the pointer, which is in the middle, is outside the window.
        screen = ["xvfb-run", "-a", "-s", "-screen 0 6000x4000x24"]
        viewer = [sys.executable, "-m", "rerun_cli", recording, layout, "--bind", HOST, "--port", "auto"]
        size = "x".join(map(str, SIZE))
        subprocess.run([*screen, *viewer, "--screenshot-to", picture, "--window-size", size], check=True)
        return cv2.resize(cv2.imread(str(picture)), SIZE, interpolation=cv2.INTER_AREA)


def in_browser(recording: Path) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR, the web viewer in a browser."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        viewer = Viewer("web", recording, at_the_end(recording, 0, Path(folder)))
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=BROWSER_FLAGS)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme="dark")
        page.goto(viewer.page)
        page.wait_for_timeout(1000 * LOADING_TIME)
        picture = page.screenshot()
        viewer.close()
    return cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)


def at_the_end(recording: Path, tab: int, folder: Path) -> Path:
    """A layout file in ``folder`` that shows the end of the episode, with one of the map's tabs in front."""
    layout = folder / "tab.rbl"
    blueprint(*arena_bounds(recording), tab=tab, is_live=True).save("sarsim", layout)
    return layout


def arena_bounds(recording: Path) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The corners (3,) of the box around the recorded arena, m."""
    vertices = []
    for chunk in RrdReader(recording).stream():
        if chunk.entity_path.startswith("/world/arena/"):
            for row in chunk.to_record_batch().to_pylist():
                vertices += row["Mesh3D:vertex_positions"]
    return np.min(vertices, axis=0), np.max(vertices, axis=0)


def save(name: str, picture: NDArray[np.uint8]) -> None:
    """Write a picture, (H, W, 3) uint8 BGR, into the folder of images."""
    cv2.imwrite(str(IMAGES / name), picture, [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
