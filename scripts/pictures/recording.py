"""Draw the pictures for viewer.md: a run's recording in the native viewer.

This needs Debian's xvfb and mesa-vulkan-drivers, but no screen.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rerun.chunk import RrdReader

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.rerun.blueprint import blueprint
from pipeline.rerun.viewer import HOST
from scripts.pictures.layout import beside, save, scaled

SIZE = (1600, 1000)
MAP_REGION = (slice(36, 730), slice(0, 1196))
"""Rows and columns of the map in the window."""


def draw(folder: Path) -> None:
    """Draw the recording of the run in a folder."""
    if shutil.which("xvfb-run") is None:
        raise InputError("xvfb-run is missing; run: apt-get install xvfb mesa-vulkan-drivers")
    recording = folder / "episode.rrd"
    semantic, metric, segments, localisation = (viewer_screenshot(recording, tab) for tab in (0, 1, 2, 4))
    save("recording-native.jpg", semantic)
    save("recording-tabs.jpg", scaled(beside(metric[MAP_REGION], segments[MAP_REGION]), 0.6))
    save("recording-localisation.jpg", localisation[MAP_REGION])


def viewer_screenshot(recording: Path, tab: int) -> Rgb:
    """(H, W, 3) image of the viewer with one of the map's tabs in front, at the end of the recording."""
    with tempfile.TemporaryDirectory() as folder:
        layout, picture = Path(folder, "tab.rbl"), Path(folder, "picture.png")
        blueprint(*arena_bounds(recording), tab=tab).save("sarsim", layout)
        # On such a large screen, the pointer, which is in the middle, is outside the window.
        screen = ["xvfb-run", "-a", "-s", "-screen 0 6000x4000x24"]
        viewer = [sys.executable, "-m", "rerun_cli", str(recording), str(layout), "--bind", HOST, "--port", "auto"]
        size = "x".join(map(str, SIZE))
        command = [*screen, *viewer, "--screenshot-to", str(picture), "--window-size", size]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)  # The viewer warns of rendering without a GPU
        with Image.open(picture) as shot:
            return np.asarray(shot.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS))


def arena_bounds(recording: Path) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The corners (3,) of the box around the recorded arena, m."""
    vertices = []
    for chunk in RrdReader(recording).stream():
        if chunk.entity_path.startswith("/world/arena/"):
            for row in chunk.to_record_batch().to_pylist():
                vertices += row["Mesh3D:vertex_positions"]
    return np.min(vertices, axis=0), np.max(vertices, axis=0)
