"""From frames to maps (thesis 3.1 to 3.3): localise, map, label, segment. It drives nothing."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.segments.planes import PlanePatch, find_planes
from pipeline.segments.segments import Segments
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.traversability.depth_dropouts import find_depth_dropouts
from pipeline.traversability.elevation_map import ElevationMap
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability
from pipeline.traversability.traversability_layer import TraversabilityLayer
from pipeline.victims.detection.detection import Detection, Detector
from pipeline.victims.victim_map import Victims

START_RADIUS = 0.5
"""m around a robot that was set down; taken for flat until it is seen: the camera sees no ground nearer than 1 m."""
START_AHEAD, START_WIDTH = 1.4, 0.8
"""m, length and width of a strip before it that is taken for flat as well."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame that is in the maps.

    Attributes:
        frame: what the camera saw.
        T_map_base: 4×4 pose of the robot at that moment, as localised.
        points: (N, 3) float32 the returns in ``map``, m.
        labels: (N,) uint8 their classes.
        patches: the planes in it.
        detections: people in the image, by their colours alone.
        traversability: where the robot may drive by all keyframes so far.
    """

    frame: Frame
    T_map_base: NDArray[np.float64]
    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    patches: list[PlanePatch]
    detections: list[Detection]
    traversability: Traversability


class Stopwatch:
    """Collects the wall time of named stages.

    Attributes:
        seconds: one entry for every time that a stage ran, by its name.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block under it."""
        begin = perf_counter()
        yield
        self.seconds[stage].append(perf_counter() - begin)


class Mapper:
    """Keeps every map of the robot.

    Attributes:
        keyframes: how many are in the maps.
        T_map_start: 4×4 pose of the first; None before it.
        stopwatch: the time that each stage took.
    """

    def __init__(
        self,
        robot: RobotModel,
        classifier: PointClassifier,
        detector: Detector | None = None,
        voxel_size: float = 0.1,
        graph: Literal["mst", "roadmap"] = "roadmap",
        seed: int = 0,
    ):
        """Begin with empty maps.

        Args:
            robot: decides what is traversable.
            classifier: labels the points.
            detector: of victims; without one the maps hold none.
            voxel_size: of the metric map, m.
            graph: what plans are made on: ``mst``, the thesis's tree, or ``roadmap``, which adds loops.
            seed: of RANSAC.
        """
        self.classifier, self.detector = classifier, detector
        self.localisation = OdometryLocalisation()
        self.metric_map = MetricMap(voxel_size)
        self.elevation_map = ElevationMap(robot)
        self.traversability_layer = TraversabilityLayer()
        self.semantic_map = SemanticMap()
        self.segments = Segments()
        self.topological_map = TopologicalMap(graph)
        self.victims = Victims()
        self.stopwatch = Stopwatch()
        self.keyframes = 0
        self.T_map_start: NDArray[np.float64] | None = None
        self._seed = seed

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` when a frame was taken."""
        with self.stopwatch("localisation"):
            T_map_base = self.localisation.localise(frame)
        if self.T_map_start is None:
            self.T_map_start = T_map_base
        return T_map_base

    def assume_ground(self, T_map_base: NDArray[np.float64]) -> None:
        """Take the ground around a robot that was just set down, and before it, for flat until it is seen."""
        self.elevation_map.assume_ground(T_map_base, START_RADIUS, START_AHEAD, START_WIDTH)

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> Keyframe:
        """Take a frame into every map but the topological one, which :meth:`connect` renews."""
        T_map_camera = T_map_base @ frame.T_base_camera
        points = frame.points(T_map_camera)
        with self.stopwatch("metric_map"):
            self.metric_map.integrate(frame.depth, frame.intrinsics, T_map_camera)
        with self.stopwatch("traversability"):
            dropouts = find_depth_dropouts(frame.depth, frame.intrinsics, T_map_camera)
            self.elevation_map.update(points, dropouts, T_map_base[:2, 3])
            traversability = self.traversability_layer.update(self.elevation_map)
        with self.stopwatch("semantic_map"):
            probabilities = self.classifier.classify(frame, points, T_map_camera)
            labels = probabilities.argmax(axis=1).astype(np.uint8)
            self.semantic_map.update(points, probabilities)
        with self.stopwatch("segments"):
            patches = find_planes(frame, labels, T_map_camera, self._seed + self.keyframes)
            self.segments.update(patches, self.keyframes)
        detections = self._find_victims(frame, T_map_camera)
        self.keyframes += 1
        return Keyframe(frame, T_map_base, points, labels, patches, detections, traversability)

    def add_drive(
        self, track: NDArray[np.float64], obstacles: NDArray[np.float32], touched: Sequence[NDArray[np.float64]]
    ) -> None:
        """Put into the elevation map what a drive has shown, m in ``map``.

        Args:
            track: (N, 2) where the middle of the robot was.
            obstacles: (M, 3) what stood in its way.
            touched: (K, 3) each, what it touched.
        """
        self.elevation_map.update(obstacles)
        self.elevation_map.add_track(track)
        for points in touched:
            self.elevation_map.add_obstacle(points)

    def connect(self, keyframe: Keyframe, paths: ShortestPaths) -> None:
        """Renew the topological map on the ground that ``paths`` reach, with what a keyframe shows."""
        with self.stopwatch("topological_map"):
            self.topological_map.update(keyframe.patches, self.segments, paths)

    def _find_victims(self, frame: Frame, T_map_camera: NDArray[np.float64]) -> list[Detection]:
        """Detect people in the image and place them on the map."""
        if self.detector is None:
            return []
        with self.stopwatch("victims"):
            detections = self.detector.detect(frame.rgb)
            self.victims.update(frame, detections, T_map_camera)
            self.semantic_map.show_people([victim.points for victim in self.victims.confirmed])
        return detections
