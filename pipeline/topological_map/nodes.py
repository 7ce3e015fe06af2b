"""Where the thesis places nodes on a segment (3.3 and 4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Place, Places
from pipeline.labels import Label
from pipeline.robot import RobotModel
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segment import Segment
from pipeline.segments.segments import Segments
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.cover import NodeCover


@dataclass(frozen=True, eq=False)
class NodePlace:
    """A position where the thesis places a node.

    Attributes:
        xy: (2,) position, m.
        label: label of its segment.
    """

    xy: Place
    label: Label


def thesis_places(
    patches: Sequence[PlanePatch], segments: Segments, cover: NodeCover, config: TopologicalMapConfig
) -> list[NodePlace]:
    """The positions on all segments and terrain patches that lie near where the robot can turn, moved there."""
    wanted = [(p, s.label) for s in segments for p in segment_nodes(s, cover.traversability.robot, config)]
    wanted += [(np.median(p.points.astype(np.float64), axis=0), p.label) for p in patches if p.label is Label.TERRAIN]
    places = []
    for place, label in wanted:
        level = np.abs(cover.traversability.elevation - place[2]) < config.same_level
        xy = cover.grid.nearest(cover.standable & level, place, config.snap)
        if xy is not None:
            places.append(NodePlace(xy, label))
    return places


def label_at(point: Place, segments: Segments, same_level: float) -> Label:
    """The label of a node at a point on the ground: straight ramp if one is within ``same_level`` m, else terrain."""
    for segment in segments.of(Label.STRAIGHT_RAMP):
        if segment.tree.query(point)[0] <= same_level:
            return Label.STRAIGHT_RAMP
    return Label.TERRAIN


def segment_nodes(segment: Segment, robot: RobotModel, config: TopologicalMapConfig) -> Places:
    """Positions (N, 3) for the nodes of a straight or inclined ramp, m; none on other segments.

    A segment that is smaller than the robot, or too steep to drive on, such as the side of a ramp, has none.
    """
    if segment.box.area >= robot.length * robot.width and segment.plane.normal[2] >= np.cos(robot.max_tilt):
        if segment.label is Label.STRAIGHT_RAMP:
            return _middles(segment, config.large_ramp)
        if segment.label is Label.INCLINED_RAMP:
            return _bottom(segment, robot.half_length + config.before_ramp)[None]
    return np.zeros((0, 3))


def _middles(segment: Segment, large: float) -> Places:
    """(N, 3) the centre of a straight ramp, or the centres of its two halves if it is longer than ``large``, m."""
    T, extent = segment.box.T_map_box, segment.box.extent
    long = int(np.argmax(extent[:2]))
    if extent[long] <= large:
        return T[None, :3, 3]
    quarter = T[:3, long] * extent[long] / 4
    return np.stack([T[:3, 3] - quarter, T[:3, 3] + quarter])


def _bottom(segment: Segment, distance: float) -> Place:
    """The position ``distance`` m in front of the bottom edge of an inclined ramp, where the robot stands level."""
    box = segment.box
    downhill = np.array([*segment.plane.normal[:2], 0.0])
    downhill /= np.linalg.norm(downhill)
    # The box's y axis runs along the slope, up or down.
    along = box.T_map_box[:3, 1] * np.sign(box.T_map_box[:3, 1] @ downhill)
    return box.T_map_box[:3, 3] + along * box.extent[1] / 2 + downhill * distance
