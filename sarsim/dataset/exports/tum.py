"""The layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012)."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.frame import Intrinsics
from sarsim.dataset.exports.export import Export, room, write_image
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene

UNITS = 5000  # of the depth images a metre


@dataclass(frozen=True)
class Tum(Export):
    """For each scene rgb/, depth/ (16 bits, 5000 a metre), label/ and a list of each, and two poses of the camera.

    groundtruth.txt is where it was, odometry.txt where dead reckoning by wheels and gyro has it.
    """

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """A sequence for each scene."""
        sequence = folder / room(entry)
        for kind in ("rgb", "depth", "label"):
            (sequence / kind).mkdir(parents=True)
        lists: dict[str, list[str]] = {kind: [] for kind in HEADERS}
        for index, frame in enumerate(scene):
            stamp = f"{frame.time:.6f}"
            depth = np.rint(frame.depth * UNITS).astype(np.uint16)
            for kind, image in (("rgb", frame.rgb), ("depth", depth), ("label", scene.label(index))):
                write_image(sequence / kind / f"{stamp}.png", image, cv2.IMWRITE_PNG_COMPRESSION, 1)
                lists[kind].append(f"{stamp} {kind}/{stamp}.png")
            T_odom_camera = frame.T_odom_base @ frame.T_base_camera
            for kind, T in (("groundtruth", scene.T_world_camera(index)), ("odometry", T_odom_camera)):
                pose = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
                lists[kind].append(" ".join([stamp, *(f"{number:.6f}" for number in pose)]))
        for kind, lines in lists.items():
            (sequence / f"{kind}.txt").write_text("\n".join([*HEADERS[kind], *lines]) + "\n")
        (sequence / "calibration.txt").write_text(calibration(scene.intrinsics))


HEADERS = {
    "rgb": ["# color images", "# timestamp filename"],
    "depth": ["# depth maps", "# timestamp filename"],
    "label": ["# label maps", "# timestamp filename"],
    "groundtruth": ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"],
    "odometry": ["# dead reckoning", "# timestamp tx ty tz qx qy qz qw"],
}


def calibration(k: Intrinsics) -> str:
    """fx fy cx cy as the benchmark's tools have them: pixel centres at whole numbers."""
    return f"# fx fy cx cy\n{k.fx:.6f} {k.fy:.6f} {k.cx - 0.5:.6f} {k.cy - 0.5:.6f}\n"
