"""Hand-made pieces of plane, and the segments that they become."""

import numpy as np

from pipeline.geometry.cells import cells_of
from pipeline.geometry.planes import Moments
from pipeline.labels import Label
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments


def patch(origin, x, y, length, width, label=Label.WALL, viewpoint=None):
    """A rectangle from ``origin`` along x and y, seen from ``viewpoint`` or from the side of x × y."""
    s, t = (g.ravel() for g in np.meshgrid(np.arange(0, length + 1e-6, 0.02), np.arange(0, width + 1e-6, 0.02)))
    points = np.array(origin) + s[:, None] * np.array(x) + t[:, None] * np.array(y)
    moments = Moments.of(points)
    side = np.cross(x, y) if viewpoint is None else np.array(viewpoint) - moments.centroid
    plane, points = moments.fit(side)[0], points.astype(np.float32)
    return PlanePatch(label, plane, moments, points, cells_of(points, 0.05)[0])


def wall_patch(x0, x1, y=0.0, z0=0.0, z1=1.2, front=True):
    """A wall along x, seen from smaller y or, if not ``front``, from larger y."""
    return patch((x0, y, z0), (1, 0, 0), (0, 0, 1), x1 - x0, z1 - z0, viewpoint=(x0, y + (-5 if front else 5), 0.5))


def deck(x0, x1, y0, y1, z=0.17, label=Label.STRAIGHT_RAMP):
    """A level rectangle, seen from above."""
    return patch((x0, y0, z), (1, 0, 0), (0, 1, 0), x1 - x0, y1 - y0, label)


def segments_of(*frames):
    """The segments that the patches of several frames become, oldest first."""
    segments = Segments()
    for keyframe, patches in enumerate(frames):
        segments.update(patches, keyframe, np.eye(4))
    return list(segments)
