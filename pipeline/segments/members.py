"""The patches that segments are made of, kept so that segments can be rebuilt when keyframe poses change."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from pipeline.arrays import Direction, Points, Pose
from pipeline.geometry.planes import Moments
from pipeline.geometry.thinning import first_in_voxels
from pipeline.labels import Label
from pipeline.segments.planes import PlanePatch
from pipeline.transforms import inverse, transform_points


@dataclass(frozen=True, eq=False)
class Member:
    """The data kept from a patch, in ``base_link`` of the keyframe that shows it.

    Attributes:
        keyframe: index of the keyframe.
        label: class of the patch.
        normal: normal of its plane.
        moments: moments of its surfels.
        outline: corners of the convex hull of its points.
        points: one of its points per voxel; a voxel has half the edge length of a cell.
    """

    keyframe: int
    label: Label
    normal: Direction
    moments: Moments
    outline: Points
    points: Points

    @classmethod
    def of(cls, patch: PlanePatch, keyframe: int, T_map_base: Pose, cell: float) -> Self:
        """The member for a patch that a keyframe at ``T_map_base`` shows; ``cell``: edge length of a cell, m."""
        across = np.eye(3)[np.abs(patch.plane.normal).argmin()]
        u = np.cross(patch.plane.normal, across)
        v = np.cross(patch.plane.normal, u)
        flat = np.ascontiguousarray(patch.points @ np.stack([u, v], axis=1), np.float32)
        corners = cv2.convexHull(flat, returnPoints=False)[:, 0]
        T = inverse(T_map_base)
        kept = first_in_voxels(patch.points, 2 / cell)
        outline, points = (transform_points(T, patch.points[some]) for some in (corners, kept))
        return cls(keyframe, patch.label, T[:3, :3] @ patch.plane.normal, patch.moments.moved(T), outline, points)
