"""The label of a convex body by its shape and place, because SDF has no labels.

The ground is the lowest height from which to a step (8 cm) above it level surfaces fill a quarter of the world's
bounding rectangle, unless as much lies above them within the P3-AT's headroom, as over the underside of a slab;
planes are endless. Of the faces of a body that do not face down, the largest decides; the body is, by the first rule
that holds:

1. if that face is tilted by at most what the P3-AT climbs (20°),
   - inclined ramp, if it is wide and tilted by more than 8°;
   - terrain, if it is level and within a step of the ground;
   - straight ramp, if it is level, wide and at most the P3-AT's headroom (0.65 m) above the ground;
   - terrain too, the floor of a higher level, if it is level, lower than a door and fills a quarter of the rectangle;
   - ceiling, if it is level and the body's underside is higher than a door (2 m) above the ground;
2. wall, if the face is within 20° of the vertical, as long as the P3-AT is wide (0.6 m with its clearance), and the
   body at most a quarter as thick; or if the body is as tall as a door;
3. clutter.

Of a heightmap each tile of about 2 m has a label of its own: terrain if it is level, at any height, inclined ramp if
the P3-AT climbs it, else clutter. The ground below another body is then that of the heightmap.

Wide is an area of at least 0.6 m × 0.6 m; to a facet of a larger surface counts what of that surface faces up.
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

DOOR = 2.0  # m, height of a door
SLENDER = 0.25  # thickness over length of a panel, at most
LARGE = 0.25  # of the world's bounding rectangle: level surfaces that fill it are the ground
_DIRECTIONS = np.array([(np.cos(angle), np.sin(angle)) for angle in np.arange(16) * np.pi / 16])
"""(16, 2) directions in a plane in which widths are measured: between two of them a width is 0.5 % larger at most."""


@cache
def _pioneer() -> RobotModel:
    """The P3-AT, whose file is read once for all bodies."""
    return robot_model()


@dataclass(frozen=True, eq=False)
class Outline:
    """What of a convex body decides its label.

    Attributes:
        low, high: m, heights of its lowest and its highest point.
        length: m, its largest width seen along the normal of its largest face, to 1 %.
        thickness: m, along that normal.
        slope: z of that unit normal; the largest of the faces that do not face down.
        area: m² of that face.
        surface: m² that face up of the surface that the face is part of.
    """

    low: float
    high: float
    length: float
    thickness: float
    slope: float
    area: float
    surface: float


def outline_of(corners: NDArray[np.float64], surface: float = 0.0) -> Outline:
    """The outline of the convex hull of ``corners`` (N, 3) m in the world, part of a ``surface`` of so many m²."""
    low, high = corners[:, 2].min(), corners[:, 2].max()
    try:
        hull = ConvexHull(corners)
    except QhullError:
        return Outline(low, high, 0.0, 0.0, 0.0, 0.0, 0.0)
    normals, face = np.unique(hull.equations[:, :3].round(4), axis=0, return_inverse=True)
    a, b, c = corners[hull.simplices].swapaxes(0, 1)
    areas = np.bincount(face.ravel(), np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2).round(6)
    areas[normals[:, 2] < -np.sin(_pioneer().max_tilt)] = 0.0
    largest = np.lexsort((normals[:, 2], areas))[-1]  # of two as large, the one that faces up
    normal, area = normals[largest], float(areas[largest])
    across = _DIRECTIONS @ np.linalg.svd(normal[None])[2][1:]
    length, thickness = float(np.ptp(corners @ across.T, axis=0).max()), float(np.ptp(corners @ normal))
    return Outline(low, high, length, thickness, float(normal[2]), area, max(area, surface))


def flat_outline_of(triangles: NDArray[np.float64], surface: float = 0.0) -> Outline:
    """The outline of flat triangles (N, 3, 3) m in the world, seen from either side, part of a ``surface`` in m²."""
    corners = triangles.reshape(-1, 3)
    sums = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).sum(axis=0) / 2
    area = float(np.linalg.norm(sums))
    normal = sums / max(area, np.finfo(float).tiny)
    across = _DIRECTIONS @ np.linalg.svd(normal[None])[2][1:]
    length, thickness = float(np.ptp(corners @ across.T, axis=0).max()), float(np.ptp(corners @ normal))
    low, high = corners[:, 2].min(), corners[:, 2].max()
    return Outline(low, high, length, thickness, abs(float(normal[2])), area, max(area, surface))


def endless(T_world: Pose) -> Outline:
    """The outline of a plane, by its 4×4 pose."""
    height = float(T_world[2, 3])
    return Outline(height, height, np.inf, 0.0, float(T_world[2, 2]), np.inf, np.inf)


def outline_of_ground(corners: NDArray[np.float64], slope: float) -> Outline:
    """The outline of a heightmap's tile, of points (N, 3) m in the world, whose unit normal has ``slope`` for z."""
    extent = np.ptp(corners, axis=0)
    area = float(extent[0] * extent[1])
    length = float(extent[:2].max())
    return Outline(corners[:, 2].min(), corners[:, 2].max(), length, float(extent[2]), slope, area, area)


def ground_of(outlines: list[Outline], footprint: float) -> float | None:
    """Height of the ground, m, of a world in a rectangle of ``footprint`` m²; None if it has none."""
    level = sorted((o.high, o.area) for o in outlines if _is_level(o))
    tops, areas = np.array(level).reshape(-1, 2).T
    robot = _pioneer()
    for top in tops.tolist():
        is_above, is_near = tops >= top, tops <= top + 2 * robot.max_step
        area = areas[is_above & is_near].sum()
        covered = areas[is_above & ~is_near & (tops <= top + robot.headroom)].sum()
        if area >= LARGE * footprint and not covered >= area:
            return top
    return None


def label_of(outline: Outline, ground: float, footprint: float) -> Label:
    """The label of a body in a rectangle of ``footprint`` m², if the ground is at height ``ground`` m."""
    robot = _pioneer()
    wide, top = 2 * clearance_of(robot), outline.high - ground
    if outline.slope >= np.cos(robot.max_tilt):
        if not _is_level(outline):
            if outline.surface >= wide**2:
                return Label.INCLINED_RAMP
        elif abs(top) <= 2 * robot.max_step:
            return Label.TERRAIN
        elif 0 < top <= robot.headroom and outline.surface >= wide**2:
            return Label.STRAIGHT_RAMP
        elif 0 < top < DOOR and outline.surface >= LARGE * footprint:
            return Label.TERRAIN
        elif outline.low - ground >= DOOR:
            return Label.CEILING
    is_upright = outline.slope <= np.sin(robot.max_tilt) and outline.length >= wide
    is_panel = is_upright and outline.thickness <= SLENDER * outline.length
    return Label.WALL if is_panel or outline.high - outline.low >= DOOR else Label.CLUTTER


def label_of_ground(slope: float) -> Label:
    """The label of natural ground, a piece of a heightmap whose unit normal has ``slope`` for z, at any height."""
    if slope > np.cos(RAMP_TILT):
        return Label.TERRAIN
    return Label.INCLINED_RAMP if slope >= np.cos(_pioneer().max_tilt) else Label.CLUTTER


def _is_level(outline: Outline) -> bool:
    return outline.slope > np.cos(RAMP_TILT)
