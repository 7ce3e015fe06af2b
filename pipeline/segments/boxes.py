"""Bounding boxes of surfaces; the thesis stores these boxes instead of the surfaces' points (figure 6)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Place, Places, Points, Pose
from pipeline.geometry.planes import Plane
from pipeline.labels import RAMP_TILT
from pipeline.transforms import from_rotation, transform_places

DIRECTIONS = np.array([(np.cos(azimuth), np.sin(azimuth)) for azimuth in np.deg2rad(np.arange(360))]).T
"""(2, 360) horizontal unit vectors, one per degree, counter-clockwise from the x axis."""


@dataclass(frozen=True, eq=False)
class OrientedBox:
    """An oriented bounding box of a piece of a plane.

    Attributes:
        T_map_box: pose of the box; the origin is the centre, and z is the plane's normal. On a slope or wall, x is
            horizontal, and y points upwards in the plane. On level ground, the rectangle with sides along x and y is
            nearly the smallest.
        extent: (3,) m, lengths along x, y and z; the length along z is the thickness due to noise.
    """

    T_map_box: Pose
    extent: NDArray[np.float64]

    @property
    def area(self) -> float:
        """Area in the plane, m²."""
        return float(self.extent[0] * self.extent[1])


def corners(box: OrientedBox) -> Places:
    """The eight corners of a box: four of the far face, then four of the face that was seen; x varies fastest."""
    signs = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
    return transform_places(box.T_map_box, signs * (box.extent / 2))


@dataclass(frozen=True, eq=False)
class Hull:
    """Extent of points in 360 horizontal directions and along z.

    Unions of hulls are exact, in whatever order hulls are united.

    Attributes:
        support: (360,) float64, support function: the maximum of x · cos(k°) + y · sin(k°) over all points, m.
        low, high: minimum and maximum z, m.
    """

    support: NDArray[np.float64]
    low: float
    high: float

    @classmethod
    def of(cls, points: Points) -> Self:
        """The hull of points."""
        support = (points[:, :2].astype(np.float64) @ DIRECTIONS).max(axis=0)
        return cls(support, float(points[:, 2].min()), float(points[:, 2].max()))

    def union(self, other: "Hull") -> "Hull":
        """The hull of both sets of points."""
        return Hull(np.maximum(self.support, other.support), min(self.low, other.low), max(self.high, other.high))

    def span(self, axis: NDArray[np.float64], origin: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2,) m, minimum and maximum along a horizontal ``axis`` (2,), relative to the point ``origin`` (2,).

        The direction of the axis is rounded to a degree.
        """
        k = round(np.rad2deg(np.arctan2(axis[1], axis[0]))) % len(self.support)
        offset = DIRECTIONS[:, k] @ origin
        return np.array([-self.support[k - len(self.support) // 2] - offset, self.support[k] - offset])


def bounding_box(plane: Plane, centre: Place, hull: Hull, thickness: float, cell: float) -> OrientedBox:
    """The bounding box of points in a plane, given their hull.

    Args:
        plane: the plane, whose normal is the box's z axis.
        centre: a point of the plane within the hull.
        hull: hull of the points.
        thickness: thickness of the box along the normal, m.
        cell: edge length of the cells in which the surface was seen, m.
    """
    n = plane.normal
    # A plane that tilts less than a ramp has no reliable direction of ascent.
    level = abs(n[2]) > np.cos(RAMP_TILT)
    x = _min_area_axis(hull, cell / 2) if level else np.array([-n[1], n[0], 0.0])
    x -= (x @ n) * n
    x /= np.linalg.norm(x)
    y = np.array([n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2], n[0] * x[1] - n[1] * x[0]])
    (left, right), (low, high) = _span(hull, x, centre), _span(hull, y, centre)
    middle = centre + x * (left + right) / 2 + y * (low + high) / 2
    return OrientedBox(from_rotation(np.array([x, y, n]).T, middle), np.array([right - left, high - low, thickness]))


def _span(hull: Hull, axis: Direction, centre: Place) -> NDArray[np.float64]:
    """(2,) m, minimum and maximum coordinate along a unit ``axis`` in the hull's plane, relative to ``centre``."""
    slant = np.hypot(axis[0], axis[1])
    if abs(axis[2]) > slant:
        return np.sort((np.array([hull.low, hull.high]) - centre[2]) / axis[2])
    return hull.span(axis[:2], centre[:2]) / slant


def _min_area_axis(hull: Hull, slack: float) -> Direction:
    """The horizontal axis of the smallest rectangle around a hull, or the map's x axis if its rectangle is similar.

    The x axis is chosen if its rectangle, with sides shorter by ``slack`` m, is as small as the smallest rectangle.
    """
    forth, back = np.split(hull.support, 2)
    along, across = np.split(forth + back, 2)
    area = along * across
    excess = slack * (along[0] + across[0])
    k = 0 if area[0] - excess <= area.min() else int(area.argmin())
    return np.array([*DIRECTIONS[:, k], 0.0])
