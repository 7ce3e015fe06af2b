"""Where the thesis puts nodes on a segment (3.3 and 4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.robot import RobotModel
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Segment
from pipeline.segments.segments import Segments
from pipeline.topological_map.cover import NodeCover
from pipeline.topological_map.node_set import NODE_SNAP

SAME_LEVEL = 0.12
"""m; ground that differs more in height from a segment does not belong to it."""
LARGE_RAMP = 1.8
"""m; a longer straight ramp has a node in each half."""


@dataclass(frozen=True, eq=False)
class NodePlace:
    """Where the thesis wants a node.

    Attributes:
        xy: (2,) m in ``map``.
        label: of its segment.
    """

    xy: NDArray[np.float64]
    label: Label


def thesis_places(patches: Sequence[PlanePatch], segments: Segments, cover: NodeCover) -> list[NodePlace]:
    """The places of all segments and of terrain patches, moved to where the robot can stand and turn."""
    ground = cover.traversability
    wanted = [(p, s.label) for s in segments for p in segment_nodes(s, ground.robot, ground.config.ramp_margin)]
    wanted += [(np.median(p.points.astype(np.float64), axis=0), p.label) for p in patches if p.label is Label.TERRAIN]
    places = []
    for place, label in wanted:
        level = np.abs(ground.elevation - place[2]) < SAME_LEVEL
        xy = cover.grid.nearest(cover.standable & level, place, NODE_SNAP)
        if xy is not None:
            places.append(NodePlace(xy, label))
    return places


def label_at(point: NDArray[np.float64], segments: Segments) -> Label:
    """The label of a node at a point (3,) of the ground, m: a straight ramp, or else the terrain."""
    for segment in segments.of(Label.STRAIGHT_RAMP):
        if segment.tree.query(point)[0] <= SAME_LEVEL:
            return Label.STRAIGHT_RAMP
    return Label.TERRAIN


def segment_nodes(segment: Segment, robot: RobotModel, ramp_margin: float) -> NDArray[np.float64]:
    """(N, 3) places in ``map`` for the nodes of a straight or an inclined ramp; none on other segments.

    A segment smaller than the robot has none, nor has one too steep to be driven on, as the side of a ramp.
    """
    if segment.box.area >= robot.length * robot.width and segment.plane.normal[2] >= np.cos(robot.max_tilt):
        if segment.label is Label.STRAIGHT_RAMP:
            return _middles(segment)
        if segment.label is Label.INCLINED_RAMP:
            return _bottom(segment, robot.half_length + ramp_margin)[None]
    return np.zeros((0, 3))


def _middles(segment: Segment) -> NDArray[np.float64]:
    """The middle of a straight ramp, or the middles of the two halves of a large one."""
    T, extent = segment.box.T_map_box, segment.box.extent
    long = int(np.argmax(extent[:2]))
    if extent[long] <= LARGE_RAMP:
        return T[None, :3, 3]
    quarter = T[:3, long] * extent[long] / 4
    return np.stack([T[:3, 3] - quarter, T[:3, 3] + quarter])


def _bottom(segment: Segment, distance: float) -> NDArray[np.float64]:
    """(3,) ``distance`` m before the bottom edge of an inclined ramp, where the whole robot stands level."""
    box = segment.box
    downhill = np.array([*segment.plane.normal[:2], 0.0])
    downhill /= np.linalg.norm(downhill)
    # The box's y axis runs along the slope, up or down.
    along = box.T_map_box[:3, 1] * np.sign(box.T_map_box[:3, 1] @ downhill)
    return box.T_map_box[:3, 3] + along * box.extent[1] / 2 + downhill * distance
