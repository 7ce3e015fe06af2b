"""Accuracy of distances in the map, measured between tags on the walls, as RoboCup Rescue scores maps.

The robot does not use the tags. They are detected in the keyframes' colour images, and located in ``map`` using
the keyframes' final poses.
"""

from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Place, Poses
from pipeline.frame import Frame
from pipeline.keyframes import Keyframes
from pipeline.mapper import Keyframe
from pipeline.sink import Sink
from pipeline.transforms import transform_points
from sarsim.arenas.things.codes import TAG_DICTIONARY, TAG_SIDE

TAG_CORNERS = TAG_SIDE / 2 * np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)], np.float64)
"""(4, 3) m, corners of the black square in OpenCV's order: x right, y up, z towards the viewer."""
MAX_PNP_DISTANCE = 1.0
"""Maximum distance, m, of a tag that is located by its corners alone, which is accurate to a few millimetres there.

The depth camera's range begins at 0.8 m.
"""


def read_fiducials(frame: Frame) -> list[tuple[int, NDArray[np.float64]]]:
    """The tags in a colour image, and the centre of each, (3,) m in ``camera_optical``.

    A tag's corners give its direction, and its depth gives the distance. If the tag is too near for the depth camera,
    the corners also give the distance (Collins and Bartoli 2014). A more distant tag without depth is left out.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    grey = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    corners, ids, _ = cv2.aruco.ArucoDetector(TAG_DICTIONARY, parameters).detectMarkers(grey)
    if ids is None:
        return []
    middles = [_tag_centre(found[0], frame) for found in corners]
    return [(int(tag), middle) for tag, middle in zip(ids.ravel(), middles, strict=True) if middle is not None]


def _tag_centre(corners: NDArray[np.float32], frame: Frame) -> Place | None:
    """(3,) m in ``camera_optical``, the point where a tag's diagonals cross; None if its distance is unknown.

    ``corners``: (4, 2) columns and rows, in which integers are pixel centres.
    """
    a, b, c, d = np.column_stack([corners.astype(np.float64), np.ones(4)])
    middle = np.cross(np.cross(a, c), np.cross(b, d))
    u, v = middle[:2] / middle[2] + 0.5
    within = cv2.fillConvexPoly(np.zeros(frame.depth.shape, np.uint8), corners.round().astype(np.int32), 1) > 0
    returns, camera = frame.depth[within & frame.returns], frame.intrinsics
    ray = np.array([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0])
    if returns.size >= within.sum() / 2:
        return float(np.median(returns)) * ray
    _, _, t = cv2.solvePnP(
        TAG_CORNERS, corners.astype(np.float64), camera.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    return float(t[2, 0]) * ray if t[2, 0] < MAX_PNP_DISTANCE else None


class FiducialScore(Sink):
    """Collects the observations of tags, and compares the distances between tags with the true ones."""

    finishing = "scoring the distances between the tags"

    def __init__(self, T_world_tag: Poses, keyframes: Keyframes) -> None:
        """Compare with ``T_world_tag``, (N, 4, 4) true poses of the tags; ``keyframes`` hold the estimated poses."""
        self._true, self._keyframes = T_world_tag[:, :3, 3], keyframes
        self._seen: list[tuple[int, int, NDArray[np.float64], float]] = []

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Read the tags in the newest keyframe."""
        frame = keyframe.frame
        for tag, middle in read_fiducials(frame):
            if tag < len(self._true):
                in_base = transform_points(frame.T_base_camera, middle[None])[0]
                self._seen.append((keyframe.index, tag, in_base, float(np.linalg.norm(middle))))

    def positions(self) -> dict[int, NDArray[np.float64]]:
        """(3,) m in ``map``, position of each tag seen: the mean, weighted by the inverse squared distance."""
        poses = self._keyframes.poses
        views: dict[int, list[tuple[NDArray[np.float64], float]]] = {}
        for keyframe, tag, in_base, distance in self._seen:
            views.setdefault(tag, []).append((transform_points(poses[keyframe], in_base[None])[0], distance**-2))
        return {tag: np.average([p for p, _ in v], axis=0, weights=[w for _, w in v]) for tag, v in views.items()}

    def figures(self) -> dict[str, Any]:
        """The number of tags found and, if it is at least two, the RMS error of the distances between the tags."""
        found = self.positions()
        errors = [
            np.linalg.norm(found[a] - found[b]) - np.linalg.norm(self._true[a] - self._true[b])
            for a, b in combinations(found, 2)
        ]
        error = {"fiducial_error_m": float(np.sqrt(np.mean(np.square(errors))))} if errors else {}
        return {"localisation": {"fiducials_found": len(found), **error}}
