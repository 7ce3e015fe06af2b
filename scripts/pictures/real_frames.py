"""Draw docs/images/real-*.jpg: real frames from a folder like ../shared/real_rgbd, and the labels of their maps.

The fractions of the labels among all labelled returns are printed.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pipeline.datasets.replay import Replay, localisation_of
from pipeline.datasets.tum_folder import read_tum_folder
from pipeline.errors import InputError
from pipeline.frame import Calibration
from pipeline.labels import COLOURS, Label
from sarsim.composition import make_mapper
from sarsim.robots.model import robot_model
from sarsim.settings import PerceptionConfig
from scripts.pictures.layout import save

DEPTH_SCALE = 5000
"""Units per metre of the depth images that are mapped."""


def read_image(path: Path, flags: int = cv2.IMREAD_COLOR) -> NDArray[Any]:
    """The image in a file; InputError if the file cannot be read."""
    image = cv2.imread(str(path), flags)
    if image is None:
        raise InputError(f"{path}: must be an image")
    return np.asarray(image)


def corridor(folder: Path) -> tuple[NDArray, NDArray, Calibration]:
    """Colour (H, W, 3), depth (H, W), m, and intrinsics of SUN RGB-D's frame, which stores rotated bits of depth."""
    depth = read_image(folder / "SUN_depth.png", cv2.IMREAD_UNCHANGED)
    turned = ((depth >> 3) | (depth << 13)).astype(np.uint16)
    return read_image(folder / "SUN_color.jpg"), turned / 1000, Calibration(570.3, 570.3, 320, 240)


def basement(folder: Path) -> tuple[NDArray, NDArray, Calibration]:
    """Colour (H, W, 3), depth (H, W), m, and intrinsics of NYU Depth v2's frame, which stores disparities."""
    raw = (folder / "NYU_depth.pgm").read_bytes()[-2 * 640 * 480 :]
    disparity = np.frombuffer(raw, "<u2").reshape(480, 640).astype(float)
    depth = np.where(disparity < 1092, 351.3 / np.maximum(1092.5 - disparity, 1), 0)
    return read_image(folder / "NYU_color.ppm"), depth, Calibration(518.9, 519.5, 325.6, 253.7)


def desk(folder: Path) -> tuple[NDArray, NDArray, Calibration]:
    """Colour (H, W, 3), depth (H, W), m, and intrinsics of TUM RGB-D's frame."""
    depth = read_image(folder / "TUM_depth.png", cv2.IMREAD_UNCHANGED) / 5000
    return read_image(folder / "TUM_color.png"), depth, Calibration(525, 525, 319.5, 239.5)


def labels_of(colour: NDArray, depth: NDArray, calibration: Calibration) -> NDArray[np.uint8]:
    """(H, W) label of each pixel's point in the map that map_recording.py makes; unlabelled without depth."""
    with TemporaryDirectory() as name:
        for kind, image in (
            ("rgb", colour),
            ("depth", np.rint(np.clip(depth, 0, 13) * DEPTH_SCALE).astype(np.uint16)),
        ):
            (Path(name) / kind).mkdir()
            cv2.imwrite(str(Path(name) / kind / "0.png"), image)
        recording = read_tum_folder(Path(name), calibration, DEPTH_SCALE, 1.0)
        mapper = make_mapper(
            PerceptionConfig(detector=None), robot_model(), localisation=localisation_of("registration")
        )
        (replayed,) = Replay(recording, mapper, "registration")
    assert replayed.keyframe is not None
    _, nearest = KDTree(mapper.semantic_map.points()).query(replayed.keyframe.points)
    labels = np.zeros(depth.shape, np.uint8)
    labels[replayed.keyframe.frame.returns] = mapper.semantic_map.labels()[nearest]
    return labels


def draw(folder: Path) -> None:
    """Map each frame, draw it next to its labels, and print the labels' fractions."""
    for frame in (corridor, basement, desk):
        colour, depth, calibration = frame(folder)
        labels = labels_of(colour, depth, calibration)
        counts = np.bincount(labels[labels > 0], minlength=len(Label))
        text = ", ".join(
            f"{label.name.lower()} {counts[label] / counts.sum():.3f}" for label in Label if counts[label]
        )
        print(f"{frame.__name__}: {text}", flush=True)
        rgb = colour[..., ::-1]
        tinted = np.where(labels[..., None] > 0, 0.45 * rgb + 0.55 * COLOURS[labels], rgb / 3)
        save(f"real-{frame.__name__}.jpg", np.hstack([rgb, tinted.astype(np.uint8)])[::2, ::2])
