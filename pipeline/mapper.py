"""From frames to maps (thesis 3.1 to 3.3): localise, map, label, segment. It drives nothing."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.localisation.correction import Correction
from pipeline.localisation.odometry import Localisation, OdometryLocalisation
from pipeline.metric_map.grid_kernels import is_rigid
from pipeline.metric_map.metric_map import MetricMap
from pipeline.metric_map.packed_depth import pack_depth, unpack_depth, unpack_returns
from pipeline.robot import RobotModel
from pipeline.segments.cells_kernels import moved
from pipeline.segments.planes import PlanePatch, find_planes
from pipeline.segments.segments import Segments
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.semantic_map import VOXEL, SemanticMap
from pipeline.semantic_map.voxels import VoxelCloud
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.transforms import inverse, transform_points
from pipeline.traversability.elevation_map import CELL, HEIGHTS, ElevationMap
from pipeline.traversability.ground_evidence import UNDER, Assumed, Driven, GroundEvidence, Seen
from pipeline.traversability.pose_paths import PosePaths
from pipeline.traversability.traversability import Traversability
from pipeline.traversability.traversability_layer import TraversabilityLayer
from pipeline.traversability.ways_up import is_no_way
from pipeline.victims.detection.detection import Detection, Detector
from pipeline.victims.victim_map import Victims

NOTICEABLE = 0.01, np.deg2rad(0.5)
"""m and rad; if a correction moves no keyframe by more than this, the maps stay as they are."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame that is in the maps.

    Attributes:
        frame: what the camera saw.
        T_map_base: 4×4 pose of the robot at that moment, as localised.
        points: (N, 3) float32 the returns in ``map``, m; empty if the frame was not labelled.
        labels: (N,) uint8 classes of the points.
        patches: planes among the points.
        detections: people in the image, by their colours alone.
        index: number of the keyframe, its index in ``Mapper.poses``.
    """

    frame: Frame
    T_map_base: NDArray[np.float64]
    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    patches: list[PlanePatch]
    detections: list[Detection]
    index: int = 0


@dataclass(frozen=True, eq=False)
class Observation:
    """What is kept of a keyframe, relative to its own pose: enough to make the maps again with other poses.

    Attributes:
        depth: (H, W) uint16, see :func:`pack_depth`.
        intrinsics: of the depth image.
        T_base_camera: 4×4.
        points: (N, 3) float32 the returns in ``base_link``, m, thinned to the voxels of the semantic
            map, or to half a cell of the elevation map if the frame was not labelled.
        hits: (N,) uint32 number of returns that each point is the mean of.
        probabilities: (N, 8) uint8, 1/255, of the points' classes; None if the frame was not labelled.
    """

    depth: NDArray[np.uint16]
    intrinsics: Intrinsics
    T_base_camera: NDArray[np.float64]
    points: NDArray[np.float32]
    hits: NDArray[np.uint32]
    probabilities: NDArray[np.uint8] | None = None

    @property
    def frame(self) -> Frame:
        """A frame of the depth alone, without colours, time and pose."""
        no_colour = np.zeros((0, 0, 3), np.uint8)
        return Frame(0.0, no_colour, unpack_returns(self.depth), self.intrinsics, self.T_base_camera, np.eye(4))


class Stopwatch:
    """Collects the wall time of named stages.

    Attributes:
        seconds: one entry for each run of a stage, by the stage's name.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block of a ``with`` statement."""
        begin = perf_counter()
        yield
        self.seconds[stage].append(perf_counter() - begin)


class Mapper:
    """Keeps every map of the robot.

    Attributes:
        observations: what is kept of each keyframe.
        poses: (N, 4, 4) ``T_map_base`` of each keyframe.
        poses_added: (N, 4, 4) ``T_map_base`` of each keyframe as estimated when it was added.
        ground: evidence of the ground, each with the number of the keyframe that it belongs to.
        loaded: number of keyframes from an earlier episode.
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
        localisation: Localisation | None = None,
    ):
        """Begin with empty maps.

        Args:
            robot: decides what is traversable.
            classifier: labels the points.
            detector: of victims; without a detector the maps hold no victims.
            voxel_size: of the metric map, m.
            graph: what plans are made on: ``mst``, the thesis's tree, or ``roadmap``, which adds loops.
            seed: of RANSAC.
            localisation: gives the poses of frames; by default those of the odometry.
        """
        self.classifier, self.detector = classifier, detector
        self.localisation: Localisation = localisation or OdometryLocalisation()
        self.metric_map = MetricMap(voxel_size)
        self.elevation_map = ElevationMap(robot)
        self._traversability_layer = TraversabilityLayer()
        self.semantic_map = SemanticMap(self._is_no_way)
        self.segments = Segments(self.metric_map.is_surface)
        self.topological_map = TopologicalMap(graph)
        self.victims = Victims()
        self.stopwatch = Stopwatch()
        self.observations: list[Observation] = []
        self.poses = self.poses_added = np.zeros((0, 4, 4))
        self.ground: list[tuple[int, GroundEvidence]] = []
        self.loaded = 0
        self._set_down: NDArray[np.float64] | None = None
        self._newest_at_drive = 0
        self._depth: NDArray[np.float32] | None = None
        self._seed = seed

    @property
    def keyframes(self) -> int:
        """Number of keyframes in the maps."""
        return len(self.observations)

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive by all keyframes so far, updated where the ground changed."""
        with self.stopwatch("traversability"):
            return self._traversability_layer.update(self.elevation_map)

    @property
    def T_map_start(self) -> NDArray[np.float64] | None:
        """4×4 pose of the first keyframe of this episode; None if it has none yet."""
        return self.poses[self.loaded] if self.keyframes > self.loaded else None

    def restore(
        self,
        observations: list[Observation],
        ground: list[tuple[int, GroundEvidence]],
        T_map_base: NDArray[np.float64],
        T_map_base_added: NDArray[np.float64],
    ) -> None:
        """Begin with the keyframes of an earlier episode, and make every map of them.

        Localisation, segments and victims must have been restored before. The parameters are the earlier mapper's
        ``observations``, ``ground``, ``poses`` and ``poses_added``, the last two (K, 4, 4).
        """
        self.observations, self.ground, self.loaded = observations, ground, len(observations)
        self.poses, self.poses_added, self._newest_at_drive = T_map_base, T_map_base_added, self.loaded
        self.correct(T_map_base)

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` when a frame was taken."""
        with self.stopwatch("localisation"):
            return self.localisation.localise(frame)

    def assume_ground(self, T_map_base: NDArray[np.float64]) -> None:
        """Take the ground around and before a robot that was just set down for level until it is seen.

        Keyframes put this ground into the elevation map as long as the robot stands there.

        Raises:
            InputError: the elevation map does not reach as low or as high.
        """
        lowest, highest = HEIGHTS
        if not lowest < T_map_base[2, 3] < highest:
            z = f"{T_map_base[2, 3]:.2f} m"
            raise InputError(f"the robot stands at {z}; ground is mapped from {lowest:.2f} to {highest:.2f} m alone")
        self._set_down = T_map_base

    def add(self, frame: Frame, T_map_base: NDArray[np.float64], labelled: bool = True) -> Keyframe:
        """Take a frame into every map but the topological one, which :meth:`connect` renews.

        A frame that is not ``labelled`` goes into the metric map and the elevation map alone.
        """
        with self.stopwatch("localisation"):
            self.localisation.add(frame, T_map_base)
        with self.stopwatch("observation"):
            depth = pack_depth(frame.depth)
            # Maps made now and maps made again of the packed depth must be the same.
            frame = replace(frame, depth=unpack_returns(depth))
            points = frame.points(frame.T_base_camera)
            cloud = VoxelCloud.of(points, VOXEL if labelled else CELL / 2)
            observation = Observation(depth, frame.intrinsics, frame.T_base_camera, cloud.points, cloud.hits)
        with self.stopwatch("metric_map"):
            self._add_depth(observation, T_map_base)
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self.poses_added = np.concatenate([self.poses_added, T_map_base[None]])
        with self.stopwatch("elevation_map"):
            self._add_ground(frame, cloud)
        nothing = np.zeros((0, 3), np.float32), np.zeros(0, np.uint8)
        keyframe = Keyframe(frame, T_map_base, *nothing, [], [], self.keyframes)
        self.observations.append(observation)
        return self._label(keyframe, points, cloud) if labelled else keyframe

    def _label(self, keyframe: Keyframe, points: NDArray[np.float32], cloud: VoxelCloud) -> Keyframe:
        """Take the newest keyframe, with (N, 3) returns in ``base_link``, into the maps that need classes."""
        frame, T_map_camera = keyframe.frame, keyframe.T_map_base @ keyframe.frame.T_base_camera
        points = moved(keyframe.T_map_base, points)
        with self.stopwatch("semantic_map"):
            probabilities = self.classifier.classify(frame, points, T_map_camera)
            labels = probabilities.argmax(axis=1).astype(np.uint8)
            shares = np.rint(cloud.means(probabilities) * 255).astype(np.uint8)
            self.observations[-1] = replace(self.observations[-1], probabilities=shares)
            self._add_classes(self.observations[-1], keyframe.T_map_base)
        with self.stopwatch("segments"):
            patches = find_planes(frame, labels, T_map_camera, self._seed + self.keyframes - 1)
            self.segments.update(patches, self.keyframes - 1, keyframe.T_map_base)
        detections = self._find_victims(frame, T_map_camera)
        return replace(keyframe, points=points, labels=labels, patches=patches, detections=detections)

    def add_drive(
        self, track: NDArray[np.float64], obstacles: NDArray[np.float32], touched: Sequence[NDArray[np.float64]]
    ) -> None:
        """Put what a drive has shown, m in ``map``, into the elevation map.

        Each point belongs to the nearest keyframe since the previous drive, and moves along with its pose.

        Args:
            track: (N, 2) positions of the robot's middle.
            obstacles: (M, 3) points of what stood in its way.
            touched: (K, 3) each, points that the robot touched.
        """
        first, self._newest_at_drive = self._newest_at_drive, self.keyframes - 1
        places = self.poses[first:, :2, 3]
        felt = np.vstack([np.zeros((0, 3)), *touched])
        near_track, *near = (_nearest(p[:, :2], places) for p in (track, obstacles, felt))
        on_ground = np.column_stack([track, self.poses[first + near_track, 2, 3]])
        for k, T in enumerate(self.poses[first:]):
            own = on_ground[near_track == k], obstacles[near[0] == k], felt[near[1] == k]
            if any(map(len, own)):
                self._put(first + k, Driven(*(transform_points(inverse(T), points) for points in own)))

    def settle(self) -> Correction | None:
        """Let the localisation correct its keyframes; if any moved by more than ``NOTICEABLE``, correct every map."""
        if not self.keyframes:
            return None
        with self.stopwatch("pose_graph"):
            self.localisation.optimise()
        change = Correction(self.poses, self.localisation.poses)
        is_noticeable = (change.ways > NOTICEABLE[0]) | (change.turns > NOTICEABLE[1])
        return self.correct(self.localisation.poses) if is_noticeable.any() else None

    def correct(self, T_map_base: NDArray[np.float64]) -> Correction:
        """Make every map anew, as if each keyframe had been taken at its (N, 4, 4) pose from the start.

        The nodes of the topological map move along; the next :meth:`connect` fits them to the ground.

        Returns:
            The correction, by which to move whatever is stored as a place in ``map``.

        Raises:
            InputError: there is not one rigid pose for every keyframe; the maps then stay as they were.
        """
        poses = np.array(T_map_base, np.float64)
        if poses.shape != self.poses.shape or not all(map(is_rigid, poses)):
            raise InputError(f"a correction must give each of {self.keyframes} keyframes a rigid 4×4 pose")
        correction, self.poses = Correction(self.poses, poses), poses
        motions = poses @ np.linalg.inv(self.poses_added)
        with self.stopwatch("correction"):
            # In two threads, for the kernels of both release Python's lock.
            with ThreadPoolExecutor(1) as other:
                voxels = other.submit(self._make_voxel_maps)
                with self.stopwatch("correction_traversability"), self.elevation_map.made_anew():
                    for k, evidence in self.ground:
                        evidence.put(self.elevation_map, self.poses[k])
                voxels.result()
            with self.stopwatch("correction_segments"):
                self.segments.rebuild(poses)
            with self.stopwatch("correction_victims"):
                self.victims.correct(correction, motions)
                self.semantic_map.show_people([victim.points for victim in self.victims.confirmed])
            with self.stopwatch("correction_topological_map"):
                self.topological_map.correct(correction)
        return correction

    def _make_voxel_maps(self) -> None:
        with self.stopwatch("correction_metric_map"):
            self.metric_map.clear()
            for observation, T in zip(self.observations, self.poses, strict=True):
                self._add_depth(observation, T)
        with self.stopwatch("correction_semantic_map"):
            self.semantic_map.clear()
            for observation, T in zip(self.observations, self.poses, strict=True):
                self._add_classes(observation, T)

    def _add_depth(self, observation: Observation, T_map_base: NDArray[np.float64]) -> None:
        T_map_camera = T_map_base @ observation.T_base_camera
        self._depth = unpack_depth(observation.depth, self._depth)
        self.metric_map.integrate(self._depth, observation.intrinsics, T_map_camera)

    def _add_ground(self, frame: Frame, cloud: VoxelCloud) -> None:
        """Put the ground that a new keyframe shows into the elevation map.

        While the robot stands where it was set down, ground near it is taken for level.
        """
        robot, k = self.elevation_map.robot, self.keyframes
        if self._set_down is not None:
            T_base_start = inverse(self.poses[k]) @ self._set_down
            if np.linalg.norm(T_base_start[:2, 3]) > (UNDER - 1) * robot.corner_radius:
                self._set_down = None
            else:
                self._put(k, Assumed.under(T_base_start, robot))
                self._put(k, Assumed.before(frame, cloud.points, robot))
        self._put(k, Seen.of(frame, cloud))

    def _put(self, keyframe: int, evidence: GroundEvidence) -> None:
        self.ground.append((keyframe, evidence))
        evidence.put(self.elevation_map, self.poses[keyframe])

    def _add_classes(self, observation: Observation, T_map_base: NDArray[np.float64]) -> None:
        if observation.probabilities is not None:
            points = moved(T_map_base, observation.points)
            self.semantic_map.update(points, observation.probabilities, observation.hits)

    def connect(self, keyframe: Keyframe, paths: PosePaths) -> None:
        """Update the topological map to the ground that ``paths`` reach and to the planes of a keyframe."""
        with self.stopwatch("topological_map"):
            self.topological_map.update(keyframe.patches, self.segments, paths)

    def _is_no_way(self, points: NDArray[np.float32], is_deck: NDArray[np.bool_]) -> NDArray[np.bool_]:
        ground = self._traversability_layer.update(self.elevation_map)
        cameras = [T[2] @ seen.T_base_camera[:, 3] for T, seen in zip(self.poses, self.observations, strict=True)]
        return is_no_way(ground, self.poses[:, :3, 3], points, is_deck & (points[:, 2] > max(cameras, default=0.0)))

    def _find_victims(self, frame: Frame, T_map_camera: NDArray[np.float64]) -> list[Detection]:
        """Detect people in the image and place them on the map."""
        if self.detector is None:
            return []
        with self.stopwatch("victims"):
            detections = self.detector.detect(frame.rgb)
            self.victims.update(frame, detections, T_map_camera, self.keyframes - 1)
            self.semantic_map.show_people([victim.points for victim in self.victims.confirmed])
        return detections


def _nearest(xy: NDArray[np.floating], places: NDArray[np.float64]) -> NDArray[np.intp]:
    """(N,) index of the place (K, 2) nearest to each of (N, 2) points, m."""
    return np.linalg.norm(xy[:, None] - places, axis=2).argmin(axis=1)
