"""The patches of which segments are made, kept so that segments can be made again at other poses of the robot."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.cells import thinned
from pipeline.labels import Label
from pipeline.segments.plane import Moments
from pipeline.segments.planes import PlanePatch
from pipeline.transforms import inverse, transform_points


@dataclass(frozen=True, eq=False)
class Member:
    """The kept data of a patch, in ``base_link`` of the keyframe that shows it.

    Attributes:
        keyframe: number of the keyframe.
        label: class of the patch.
        normal: (3,) of its plane.
        moments: of its surfels.
        outline: (V, 3) float32 corners of the convex hull of its points, m.
        points: (N, 3) float32, m, one of its points in each cube with half the edge of a cell.
    """

    keyframe: int
    label: Label
    normal: NDArray[np.float64]
    moments: Moments
    outline: NDArray[np.float32]
    points: NDArray[np.float32]

    @classmethod
    def of(cls, patch: PlanePatch, keyframe: int, T_map_base: NDArray[np.float64]) -> Self:
        """The member of a patch that a keyframe at the 4×4 pose ``T_map_base`` shows."""
        across = np.eye(3)[np.abs(patch.plane.normal).argmin()]
        u = np.cross(patch.plane.normal, across)
        v = np.cross(patch.plane.normal, u)
        flat = np.ascontiguousarray(patch.points @ np.stack([u, v], axis=1), np.float32)
        corners = cv2.convexHull(flat, returnPoints=False)[:, 0]
        T = inverse(T_map_base)
        outline, points = (
            transform_points(T, some).astype(np.float32) for some in (patch.points[corners], thinned(patch.points))
        )
        return cls(keyframe, patch.label, T[:3, :3] @ patch.plane.normal, patch.moments.moved(T), outline, points)
