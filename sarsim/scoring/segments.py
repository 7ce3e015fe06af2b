"""How well the robot's segments fit the true faces."""

from typing import Any

import numpy as np
from shapely import MultiPoint

from pipeline.segments.boxes import corners
from pipeline.segments.segments import Segment, Segments
from sarsim.ground_truth.faces import Face, plane_axes

MAX_ANGLE = np.deg2rad(20)
MAX_DISTANCE = 0.15  # m; a segment is compared with faces whose plane is no further from its middle


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
    x, y = plane_axes(face.normal)
    box, outline = (
        MultiPoint(np.column_stack([points @ x, points @ y])).convex_hull
        for points in (corners(segment.box), face.outline)
    )
    return float(box.intersection(outline).area / box.union(outline).area)
