"""Small maps for the tests of the topological map."""

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability, assess_map
from pipeline.geometry.cells import cells_of
from pipeline.geometry.planes import Moments
from pipeline.labels import Label
from pipeline.planning.pose_paths import PosePaths
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from pipeline.topological_map.topological_map import GraphKind, TopologicalMap
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

Wall = tuple[tuple[float, float], tuple[float, float]]

U_TURN: list[Wall] = [((0, -2), (0, 0.8))]
"""A wall that ends 1.2 m before the north end of its room."""


def patch(label: Label, points: NDArray, seen_from: tuple[float, float, float]) -> PlanePatch:
    moments = Moments.of(points)
    plane, _ = moments.fit(np.array(seen_from) - moments.centroid)
    return PlanePatch(label, plane, moments, points, cells_of(points, 0.05)[0])


def room(x: tuple[float, float], y: tuple[float, float], walls: list[Wall]) -> tuple[Traversability, Segments]:
    """Level ground with walls in it, as its traversability and as segments."""
    clouds = [wall_points(a, b) for a, b in walls]
    segments = Segments()
    segments.update([patch(Label.WALL, cloud, (x[0], y[0], 1)) for cloud in clouds], 0, np.eye(4))
    return assess_map(surface_of(ground_points(flat, x, y), *clouds)), segments


def topology_of(
    traversability: Traversability, segments: Segments, start: tuple[float, float], graph: GraphKind = "roadmap"
) -> TopologicalMap:
    topology = TopologicalMap(graph)
    topology.update([], segments, PosePaths(traversability, start))
    return topology
