"""Where the thesis puts nodes on a segment (3.3 and 4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segment, Segments
from pipeline.topological_map.ground import Ground

LEVEL = 0.12
"""m; ground that differs more in height from a segment does not belong to it."""


@dataclass(frozen=True)
class NodeConfig:
    """Which places become nodes.

    Attributes:
        large_ramp: a straight ramp longer than this has a node in each half, m.
        foot_distance: of a node from the bottom edge of its inclined ramp, m: the whole robot stands level.
        max_slope: a steeper plane is a ramp's side, rad.
        min_area: smaller segments have no nodes, m².
        snap: a node is moved no further than this to where the robot can stand and turn, m.
    """

    large_ramp: float = 1.8
    foot_distance: float = 0.45
    max_slope: float = np.deg2rad(35)
    min_area: float = 0.1
    snap: float = 0.4


@dataclass(frozen=True, eq=False)
class Place:
    """Where the thesis wants a node.

    Attributes:
        xy: (2,) m in ``map``.
        label: of the segment.
    """

    xy: NDArray[np.float64]
    label: Label


def thesis_places(
    patches: Sequence[PlanePatch], segments: Segments, ground: Ground, config: NodeConfig
) -> list[Place]:
    """The places by segment, moved to where the robot can stand and turn."""
    wanted = [(p, s.label) for s in segments for p in segment_nodes(s, config)]
    wanted += [
        (np.median(p.points.astype(np.float64), axis=0), p.label) for p in patches if p.label is Label.TERRAIN
    ]
    places = []
    for place, label in wanted:
        level = np.abs(ground.traversability.elevation - place[2]) < LEVEL
        xy = ground.grid.nearest(ground.standable & level, place, config.snap)
        if xy is not None:
            places.append(Place(xy, label))
    return places


def label_at(point: NDArray[np.float64], segments: Segments) -> Label:
    """What a node at a point (3,) of the ground stands on: a straight ramp, or else the terrain."""
    for segment in segments.of(Label.STRAIGHT_RAMP):
        if segment.tree.query(point)[0] <= LEVEL:
            return Label.STRAIGHT_RAMP
    return Label.TERRAIN


def segment_nodes(segment: Segment, config: NodeConfig) -> NDArray[np.float64]:
    """(N, 3) places in ``map`` for the nodes of a straight or an inclined ramp; none on other segments."""
    if segment.box.area < config.min_area or segment.plane.normal[2] < np.cos(config.max_slope):
        return np.zeros((0, 3))
    if segment.label is Label.STRAIGHT_RAMP:
        return _middles(segment, config)
    if segment.label is Label.INCLINED_RAMP:
        return _bottom(segment, config)[None]
    return np.zeros((0, 3))


def _middles(segment: Segment, config: NodeConfig) -> NDArray[np.float64]:
    """The middle of a straight ramp, or the middles of the two halves of a large one."""
    T, extent = segment.box.T_map_box, segment.box.extent
    long = int(np.argmax(extent[:2]))
    if extent[long] <= config.large_ramp:
        return T[None, :3, 3]
    quarter = T[:3, long] * extent[long] / 4
    return np.stack([T[:3, 3] - quarter, T[:3, 3] + quarter])


def _bottom(segment: Segment, config: NodeConfig) -> NDArray[np.float64]:
    """Before the bottom edge of an inclined ramp, where the robot does not slide."""
    box = segment.box
    downhill = np.array([*segment.plane.normal[:2], 0.0])
    downhill /= np.linalg.norm(downhill)
    # The box's y axis runs along the slope, up or down.
    along = box.T_map_box[:3, 1] * np.sign(box.T_map_box[:3, 1] @ downhill)
    return box.T_map_box[:3, 3] + along * box.extent[1] / 2 + downhill * config.foot_distance
