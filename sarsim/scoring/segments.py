"""Scores how well the robot's segments fit the parts of the true surfaces that came into view."""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from shapely import MultiPoint, Polygon

from pipeline.segments.boxes import corners
from pipeline.segments.segment import Segment
from pipeline.segments.segments import Segments
from sarsim.ground_truth.faces import Face, plane_axes
from sarsim.scoring.segments_kernels import ROW_STRIDE, cells_on_plane

MAX_ANGLE = np.deg2rad(20)  # rad, maximum angle between a segment and the planes with which it is compared
MAX_DISTANCE = 0.15  # m, maximum distance from a segment's centre to the planes with which it is compared
PLANE_BIN = 0.01
"""Bin size for offsets, m, and unit normals; faces in one bin form one surface, such as a wall's panels."""
BIN_SHIFT = 0.37  # Shift of the bins, in bins, so that round values, such as panels' offsets, are not on a border
MAX_POINT_DISTANCE = 0.005  # m, maximum distance of noise-free points from the true face on which they lie
STRIDE = 4  # Only every fourth return marks surfaces as seen
SURFACE_CELL = 0.025  # m, edge length of a cell of a surface
CELL_CORNERS = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])  # Corners of a cell
MAX_PIECE_GAP = 2  # Cells; seen parts of a surface at most this far apart form one piece
MIN_LEVEL_NORMAL_Z = 0.99  # Vertical component of a unit normal above which a plane is considered level


class SegmentScore:
    """Records which parts of the true surfaces came into view, and compares the robot's segments with them."""

    def __init__(self, faces: list[Face], are_whole: bool = False) -> None:
        """``are_whole``: treat all faces as seen, because the parts that an earlier episode saw are unknown."""
        self._whole = faces if are_whole else []
        self._surfaces: dict[tuple[float, ...], _Surface] = {}
        self._surfaces_of_geom: dict[int, set[_Surface]] = defaultdict(set)
        for face in faces:
            plane = np.array([face.label, *face.normal, face.normal @ face.outline[0]])
            surface = self._surfaces.setdefault(tuple(np.round(plane / PLANE_BIN + BIN_SHIFT)), _Surface(face))
            self._surfaces_of_geom[face.geom].add(surface)

    def add(self, points: NDArray[np.float32], geoms: NDArray[np.int32]) -> None:
        """Mark the parts that noise-free returns show: points (N, 3), m in ``world``, and their geoms' ids (N,)."""
        points, geoms = points[::STRIDE], geoms[::STRIDE]
        order = np.argsort(geoms, kind="stable")
        points, geoms = points[order], geoms[order]
        shown, first = np.unique(geoms, return_index=True)
        for geom, begin, end in zip(shown.tolist(), first, np.append(first, len(geoms))[1:], strict=True):
            for surface in self._surfaces_of_geom.get(geom, ()):
                surface.see(points[begin:end])

    def report(self, segments: Segments) -> dict[str, Any]:
        """The figures of the segments, each compared with the piece of a surface of its label that it overlaps most.

        If no segment overlaps a piece, the angle error is 180° and the intersection over union is 0.
        """
        faces = self._whole or [piece for surface in self._surfaces.values() for piece in surface.pieces()]
        matches = [match for segment in segments if (match := _match(segment, faces)) is not None]
        report: dict[str, Any] = {"planes": len(segments), "matched": len(matches)}
        angles, ious = np.array(matches).reshape(-1, 2).T
        return report | {
            "angle_error_deg": {"median": float(np.median(np.degrees(angles))) if len(matches) else 180.0},
            "boxes_iou": {"median": float(np.median(ious)) if len(matches) else 0.0},
        }


class _Surface:
    """All faces of one label in one plane, and the cells of the plane that came into view."""

    def __init__(self, face: Face) -> None:
        self._face = face
        self._offset = face.normal @ face.outline[0]
        self._axes = np.stack(plane_axes(face.normal), axis=1)
        self._seen = np.zeros(0, np.int64)

    def see(self, points: NDArray[np.float32]) -> None:
        """Mark the cells of the points (N, 3) that lie on the plane."""
        cells = cells_on_plane(points, self._face.normal, self._offset, self._axes, MAX_POINT_DISTANCE, SURFACE_CELL)
        cells = np.unique(cells)
        before = np.searchsorted(self._seen, cells)
        is_new = np.append(self._seen, np.iinfo(np.int64).min)[before] != cells
        self._seen = np.insert(self._seen, before[is_new], cells[is_new])

    def pieces(self) -> Iterator[Face]:
        """Yield a rectangle around each seen part, with two horizontal sides or, on level planes, of minimum area."""
        keys = self._seen
        rows = (keys + ROW_STRIDE // 2) // ROW_STRIDE
        cells = np.column_stack([rows, keys - rows * ROW_STRIDE])
        low = cells.min(axis=0, initial=0) - MAX_PIECE_GAP
        image = np.zeros(cells.max(axis=0, initial=0) - low + MAX_PIECE_GAP, bool)
        where = tuple((cells - low).T)
        image[where] = True
        pieces, count = ndimage.label(ndimage.binary_dilation(image, np.ones((MAX_PIECE_GAP + 1, MAX_PIECE_GAP + 1))))
        for n in range(1, count + 1):
            ends = row_ends(cells[pieces[where] == n])  # far fewer cells with the same convex hull
            inside = MultiPoint(SURFACE_CELL * (ends[:, None] + CELL_CORNERS).reshape(-1, 2))
            is_level = abs(self._face.normal[2]) > MIN_LEVEL_NORMAL_Z
            around = inside.minimum_rotated_rectangle if is_level else inside.envelope
            if isinstance(around, Polygon):
                outline = np.array(around.exterior.coords)[:4] @ self._axes.T + self._offset * self._face.normal
                yield Face(self._face.geom, self._face.label, self._face.normal, outline)


def row_ends(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(M, 2) the first and the last cell of each row of sorted cells (N, 2)."""
    is_first = np.diff(cells[:, 0], prepend=cells[0, 0] - 1) > 0
    return cells[is_first | np.roll(is_first, -1)]


def _match(segment: Segment, faces: list[Face]) -> tuple[float, float] | None:
    """Angle, rad, and intersection over union of a segment and the face it overlaps most; None without overlap."""
    middle = segment.box.T_map_box[:3, 3]
    candidates = []
    for face in faces:
        angle = float(np.arccos(np.clip(segment.plane.normal @ face.normal, -1, 1)))
        distance = abs((middle - face.outline[0]) @ face.normal)
        if face.label == segment.label and angle < MAX_ANGLE and distance < MAX_DISTANCE:
            candidates.append((angle, _iou(segment, face)))
    best = max(candidates, key=lambda match: match[1], default=(0.0, 0.0))
    return best if best[1] > 0 else None


def _iou(segment: Segment, face: Face) -> float:
    """Intersection over union of a segment's box and a face, both seen along the face's normal."""
    x, y = plane_axes(face.normal)
    box, outline = (
        MultiPoint(np.column_stack([points @ x, points @ y])).convex_hull
        for points in (corners(segment.box), face.outline)
    )
    return float(box.intersection(outline).area / box.union(outline).area)
