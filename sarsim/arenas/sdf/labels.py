"""Labels convex bodies by shape and position, because SDF has no labels.

The ground is at the lowest height such that level surfaces up to a step (8 cm) above this height fill a quarter of
the world's bounding rectangle. To exclude the undersides of slabs, a height does not count if level surfaces above
the step, but within the P3-AT's headroom, have at least the same area. The area of a plane is infinite.

The label of a body depends on its main face, the largest of its faces that do not face down. The first rule that
applies gives the label:

1. if the main face is tilted by at most the slope that the P3-AT can climb (20°),
   - inclined ramp, if it is wide and tilted by more than 8°;
   - terrain, if it is level and within a step of the ground;
   - deck (``STRAIGHT_RAMP``), if it is level, wide and at most the P3-AT's headroom (0.65 m) above the ground;
   - terrain (the floor of a higher level) if it is level, lower than a door and fills a quarter of the rectangle;
   - ceiling, if it is level and the body's underside is at least the height of a door (2 m) above the ground;
2. wall,
   - if the body is at least as tall as a door, or
   - if the main face is within 20° of the vertical and at least as long as the P3-AT is wide (0.6 m with clearance),
     and the body's thickness is at most a quarter of the face's length;
3. clutter.

Each tile of a heightmap (about 2 m) has its own label: terrain if it is level, at any height; inclined ramp if the
P3-AT can climb it; otherwise clutter. For other bodies above a heightmap, the heightmap is the ground.

A face is wide if its area is at least 0.6 m × 0.6 m. A facet of a larger surface is wide if the upward-facing part of
the surface has this area.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from pipeline.arrays import Pose
from pipeline.labels import RAMP_TILT, Label
from pipeline.robot import RobotModel
from sarsim.ground_truth.true_surface import clearance_of
from sarsim.robots.skid_steered import robot_model

DOOR_HEIGHT = 2.0  # m, height of a door
MAX_THICKNESS_RATIO = 0.25  # Maximum ratio of thickness to length of a panel
MIN_GROUND_FRACTION = 0.25
"""Fraction of the world's bounding rectangle that level surfaces must fill to be the ground."""
_DIRECTIONS = np.array([(np.cos(angle), np.sin(angle)) for angle in np.arange(16) * np.pi / 16])
"""(16, 2) directions in a plane along which widths are measured; the true maximum is at most 0.5% larger."""


@cache
def _pioneer() -> RobotModel:
    """The P3-AT; its file is read once."""
    return robot_model()


@dataclass(frozen=True, eq=False)
class ShapeFeatures:
    """The properties of a convex body that determine its label.

    The main face is the largest of the faces that do not face down.

    Attributes:
        low, high: heights of the lowest and highest point, m.
        length: maximum width as seen along the normal of the main face, accurate to 1%, m.
        thickness: extent along that normal, m.
        normal_z: z component of the unit normal of the main face.
        area: area of the main face, m².
        upward_area: upward-facing area of the surface to which the main face belongs, m².
    """

    low: float
    high: float
    length: float
    thickness: float
    normal_z: float
    area: float
    upward_area: float


def shape_features(corners: NDArray[np.float64], upward_area: float = 0.0) -> ShapeFeatures:
    """The features of the convex hull of ``corners`` (N, 3) m in ``world``; ``upward_area``: see ShapeFeatures."""
    low, high = corners[:, 2].min(), corners[:, 2].max()
    try:
        hull = ConvexHull(corners)
    except QhullError:
        return ShapeFeatures(low, high, 0.0, 0.0, 0.0, 0.0, 0.0)
    normals, face = np.unique(hull.equations[:, :3].round(4), axis=0, return_inverse=True)
    a, b, c = corners[hull.simplices].swapaxes(0, 1)
    areas = np.bincount(face.ravel(), np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2).round(6)
    areas[normals[:, 2] < -np.sin(_pioneer().max_tilt)] = 0.0
    largest = np.lexsort((normals[:, 2], areas))[-1]  # of faces with equal areas, the most upward-facing
    normal, area = normals[largest], float(areas[largest])
    across = _DIRECTIONS @ np.linalg.svd(normal[None])[2][1:]
    length, thickness = float(np.ptp(corners @ across.T, axis=0).max()), float(np.ptp(corners @ normal))
    return ShapeFeatures(low, high, length, thickness, float(normal[2]), area, max(area, upward_area))


def flat_shape_features(triangles: NDArray[np.float64], upward_area: float = 0.0) -> ShapeFeatures:
    """The features of coplanar triangles (N, 3, 3) m in ``world``; ``upward_area``: see ShapeFeatures."""
    corners = triangles.reshape(-1, 3)
    sums = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).sum(axis=0) / 2
    area = float(np.linalg.norm(sums))
    normal = sums / max(area, np.finfo(float).tiny)
    across = _DIRECTIONS @ np.linalg.svd(normal[None])[2][1:]
    length, thickness = float(np.ptp(corners @ across.T, axis=0).max()), float(np.ptp(corners @ normal))
    low, high = corners[:, 2].min(), corners[:, 2].max()
    return ShapeFeatures(low, high, length, thickness, abs(float(normal[2])), area, max(area, upward_area))


def plane_features(T_world: Pose) -> ShapeFeatures:
    """The features of an infinite plane with a 4×4 pose."""
    height = float(T_world[2, 3])
    return ShapeFeatures(height, height, np.inf, 0.0, float(T_world[2, 2]), np.inf, np.inf)


def heightmap_features(corners: NDArray[np.float64], normal_z: float) -> ShapeFeatures:
    """The features of a heightmap's tile with points (N, 3) m in ``world``; ``normal_z``: z of its unit normal."""
    extent = np.ptp(corners, axis=0)
    area = float(extent[0] * extent[1])
    length = float(extent[:2].max())
    return ShapeFeatures(corners[:, 2].min(), corners[:, 2].max(), length, float(extent[2]), normal_z, area, area)


def ground_height_of(features: list[ShapeFeatures], footprint: float) -> float | None:
    """Height of the ground, m, in a world of ``footprint`` m²; None if the world has no ground."""
    level = sorted((o.high, o.area) for o in features if _is_level(o))
    tops, areas = np.array(level).reshape(-1, 2).T
    robot = _pioneer()
    for top in tops.tolist():
        is_above, is_near = tops >= top, tops <= top + 2 * robot.max_step
        area = areas[is_above & is_near].sum()
        covered = areas[is_above & ~is_near & (tops <= top + robot.headroom)].sum()
        if area >= MIN_GROUND_FRACTION * footprint and not covered >= area:
            return top
    return None


def label_of(features: ShapeFeatures, ground: float, footprint: float) -> Label:
    """The label of a body in a world of ``footprint`` m² with the ground at height ``ground`` m."""
    robot = _pioneer()
    wide, top = 2 * clearance_of(robot), features.high - ground
    if features.normal_z >= np.cos(robot.max_tilt):
        if not _is_level(features):
            if features.upward_area >= wide**2:
                return Label.INCLINED_RAMP
        elif abs(top) <= 2 * robot.max_step:
            return Label.TERRAIN
        elif 0 < top <= robot.headroom and features.upward_area >= wide**2:
            return Label.STRAIGHT_RAMP
        elif 0 < top < DOOR_HEIGHT and features.upward_area >= MIN_GROUND_FRACTION * footprint:
            return Label.TERRAIN
        elif features.low - ground >= DOOR_HEIGHT:
            return Label.CEILING
    is_upright = features.normal_z <= np.sin(robot.max_tilt) and features.length >= wide
    is_panel = is_upright and features.thickness <= MAX_THICKNESS_RATIO * features.length
    return Label.WALL if is_panel or features.high - features.low >= DOOR_HEIGHT else Label.CLUTTER


def label_of_ground(normal_z: float) -> Label:
    """The label of a heightmap's tile, whatever its height; ``normal_z``: z of its unit normal."""
    if normal_z > np.cos(RAMP_TILT):
        return Label.TERRAIN
    return Label.INCLINED_RAMP if normal_z >= np.cos(_pioneer().max_tilt) else Label.CLUTTER


def _is_level(features: ShapeFeatures) -> bool:
    return features.normal_z > np.cos(RAMP_TILT)
