"""The true plane faces of an arena's geoms, and how well the robot's segments fit them."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from shapely import MultiPoint

from pipeline.labels import PLANAR, Label
from pipeline.segments.boxes import corners
from pipeline.segments.segments import Segment, Segments
from sarsim.sensors.camera import geom_labels

MAX_ANGLE = np.deg2rad(20)
MAX_DISTANCE = 0.15
"""m; a segment is compared with faces whose plane is no further from its middle."""


@dataclass(frozen=True, eq=False)
class Face:
    """A convex plane face of a geom.

    Attributes:
        label: of the geom.
        normal: (3,) outward, of length 1.
        outline: (N, 3) m in the world, in order around the face.
    """

    label: Label
    normal: NDArray[np.float64]
    outline: NDArray[np.float64]


def true_faces(model: mujoco.MjModel, data: mujoco.MjData) -> list[Face]:
    """The faces of all planes, boxes and (convex) meshes that carry a planar label."""
    labels = geom_labels(model)
    faces = []
    for geom in np.flatnonzero(np.isin(labels, PLANAR)):
        vertices = _vertices(model, int(geom))
        if vertices is not None:
            world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            faces += _faces(Label(labels[geom]), world)
    return faces


def _vertices(model: mujoco.MjModel, geom: int) -> NDArray[np.float64] | None:
    """(N, 3) corners of a geom in its own frame; None if it is round."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * np.where(size > 0, size, 25.0)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)
    return None


def _faces(label: Label, vertices: NDArray[np.float64]) -> list[Face]:
    """The faces of the convex hull of vertices; of four vertices in a plane, that one face upwards."""
    if len(vertices) == 4:
        normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
        return [Face(label, normal / np.linalg.norm(normal), vertices)]
    hull = ConvexHull(vertices)
    planes = np.unique(hull.equations.round(6), axis=0) * [1, 1, 1, -1]  # n · x = d, as everywhere
    return [Face(label, plane[:3], _outline(vertices, plane)) for plane in planes]


def _outline(vertices: NDArray[np.float64], plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices on a plane, in order around their middle."""
    on_plane = vertices[np.abs(vertices @ plane[:3] - plane[3]) < 1e-4]
    x, y = _axes(plane[:3])
    offset = on_plane - on_plane.mean(axis=0)
    return on_plane[np.argsort(np.arctan2(offset @ y, offset @ x))]


def score_segments(segments: Segments, faces: list[Face]) -> dict[str, Any]:
    """Compare every segment with the true face of its label that it overlaps most."""
    matches = [match for segment in segments if (match := _match(segment, faces)) is not None]
    report: dict[str, Any] = {"planes": len(segments), "matched": len(matches)}
    angles, ious = np.array(matches).reshape(-1, 2).T
    return report | {
        "angle_error_deg": {"median": float(np.median(np.degrees(angles))) if len(matches) else 180.0},
        "boxes_iou": {"median": float(np.median(ious)) if len(matches) else 0.0},
    }


def _match(segment: Segment, faces: list[Face]) -> tuple[float, float] | None:
    """Angle in rad and intersection over union with the face that fits best; None if none overlaps."""
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
    x, y = _axes(face.normal)
    box, outline = (
        MultiPoint(np.column_stack([points @ x, points @ y])).convex_hull
        for points in (corners(segment.box), face.outline)
    )
    return float(box.intersection(outline).area / box.union(outline).area)


def _axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two axes of a plane."""
    x = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return x, np.cross(normal, x)
