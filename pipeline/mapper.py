"""From frames to maps (thesis 3.1 to 3.3): localise, map, label, segment. The mapper never drives."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Points, Pose, Probabilities
from pipeline.config import PipelineConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.ground_evidence import AssumedGround, DrivenTrack, GroundEvidence
from pipeline.elevation_map.traversability import Traversability, TraversabilityLayer
from pipeline.frame import Frame
from pipeline.geometry.moving_kernels import moved
from pipeline.keyframes import KeyframeObservation, Keyframes, Moves, nearest_keyframes
from pipeline.localisation.belief import Belief
from pipeline.localisation.localisation import Localisation, LocalisedFrame
from pipeline.localisation.pose_check import ConfirmedPose
from pipeline.localisation.slam import Slam
from pipeline.metric_map.isolated_returns import remove_isolated_returns
from pipeline.metric_map.metric_map import MetricMap
from pipeline.planning.pose_paths import PosePaths
from pipeline.robot import RobotModel
from pipeline.segments.planes import PlanePatch, find_planes
from pipeline.segments.segments import Segments
from pipeline.semantic_map.classifier import PointClassifier, check_probabilities
from pipeline.semantic_map.revision import Revision
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.stopwatch import Stopwatch
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.tracks.finds import Finds
from pipeline.transforms import inverse, transform_points, yaw_of
from pipeline.victims.detection import Detection, Detector
from pipeline.victims.readers import BackgroundReader, FindReader
from pipeline.victims.victim_map import Victims


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame that has been added to the maps, with the results for this frame at that time.

    Attributes:
        frame: the camera's images, with their time and poses.
        T_map_base: 4×4 estimated pose of the robot at the time of the frame.
        points: (N, 3) float32 returns in ``map``, m; empty if the frame was not labelled.
        labels: (N,) uint8 classes of the points.
        patches: planes among the points.
        detections: people detected in the colour image; empty if the frame was not labelled, because its image is
            then searched while the robot drives on (see :meth:`MapObserver.on_detections`).
        index: index of the keyframe.
    """

    frame: Frame
    T_map_base: NDArray[np.float64]
    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    patches: list[PlanePatch]
    detections: list[Detection]
    index: int = 0


START_RADIUS = 0.2
"""Distance from the start within which the robot still assumes that the ground around the start is level, m."""


class MapObserver(Protocol):
    """Receives the events of a mapper."""

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Called when a keyframe has been added to the maps."""

    def on_detections(self, keyframe: int, frame: Frame, detections: list[Detection]) -> None:
        """Called when a keyframe's image has been searched for people, at the latest before the next keyframe."""

    def on_correction(self, moves: Moves) -> None:
        """Called when the maps have been rebuilt where keyframe poses were corrected."""


class Mapper:
    """Keeps all of the robot's maps.

    Attributes:
        observers: notified of all events, in the order of this list.
        config: all parameters.
        policy: when a frame becomes a keyframe, and which keyframes are labelled.
        keyframes: the observations and poses of all keyframes.
        knows_camera: whether the camera's pose on the robot is known, and hence the ground at the start.
        stopwatch: the time that each stage has taken.
    """

    def __init__(
        self,
        robot: RobotModel,
        classifier: PointClassifier,
        detector: Detector | None = None,
        graph: Literal["mst", "roadmap"] = "roadmap",
        seed: int = 0,
        localisation: Localisation | None = None,
        readers: FindReader | None = None,
        config: PipelineConfig = PipelineConfig(),
    ):
        """Start with empty maps.

        Args:
            robot: the robot's size and abilities, which determine the traversable ground.
            classifier: labels the points.
            detector: detects victims; without a detector, the maps contain no victims.
            graph: the graph used for planning: ``mst``, the thesis's tree, or ``roadmap``, which adds loops.
            seed: seed of RANSAC.
            localisation: estimates the poses of frames; by default odometry corrected by registration (SLAM).
            readers: read signs, codes and other finds; without readers, people are the only finds.
            config: all parameters.
        """
        self.observers: list[MapObserver] = []
        self.config, self.policy = config, config.localisation.keyframes
        self.classifier, self.detector, self.readers = classifier, detector, readers
        self._background = BackgroundReader(config.victims.heat)
        self.localisation: Localisation = localisation or Slam(config=config.localisation)
        self.metric_map = MetricMap(config.metric_map)
        self.elevation_map = ElevationMap(robot, config.elevation_map)
        self._traversability_layer = TraversabilityLayer()
        self.semantic_map = SemanticMap(config=config.semantic_map)
        self.segments = Segments(self.metric_map.is_surface, config=config.segments)
        self.topological_map = TopologicalMap(graph, config=config.topological_map)
        reach, cell = self.metric_map.max_range, self.elevation_map.grid.cell
        self.keyframes = Keyframes(robot, reach, cell, config.keyframes.min_displacement)
        self.victims = Victims(config.tracks.victim)
        self.finds = Finds(self.victims, config.tracks, getattr(readers, "kinds", None))
        self.stopwatch = Stopwatch()
        self.knows_camera = True
        self._set_down: NDArray[np.float64] | None = None
        self._start_height = 0.0
        self._newest_at_drive = 0
        self._T_odom_keyframe: Pose | None = None
        self._seed = seed

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive according to all keyframes so far, updated where the ground changed."""
        with self.stopwatch("traversability"):
            return self._traversability_layer.update(self.elevation_map)

    @property
    def drivable(self) -> Traversability:
        """Where the robot may drive if it also keeps away from the confirmed people, and slows down near them."""
        people, ground = self.people, self.traversability
        if not people:
            return ground
        limit = self.config.navigation.speed_limit
        been = self.elevation_map.swept
        return ground.keeping_off(np.concatenate(people), been, limit.beside_people, limit.speed_near_people)

    @property
    def people(self) -> list[Points]:
        """The points of each confirmed person, m."""
        return [victim.points for victim in self.victims.confirmed]

    @property
    def T_map_odom(self) -> Pose:
        """Pose of ``odom`` in ``map``, estimated from the newest frame."""
        return self.localisation.T_map_odom

    @property
    def belief(self) -> Belief:
        """The localisation's belief about the robot's motion and position."""
        return self.localisation.belief

    @property
    def T_map_start(self) -> NDArray[np.float64] | None:
        """4×4 pose of this episode's first keyframe; None before that keyframe."""
        keyframes = self.keyframes
        return keyframes.poses[keyframes.loaded_count] if len(keyframes) > keyframes.loaded_count else None

    def restore(self) -> None:
        """Build every map from an earlier episode's keyframes, segments and tracks, which the caller has added."""
        self.keyframes.loaded_count = self._newest_at_drive = len(self.keyframes)
        self._start_height = self.keyframes.start_height
        self._rebuild(np.ones(len(self.keyframes), np.bool_), self.keyframes.boxes())
        self.revise_labels()

    def is_due(self, T_odom_base: Pose) -> bool:
        """Whether the robot has moved far enough since the last keyframe for another keyframe."""
        last = self._T_odom_keyframe
        return last is None or self.policy.is_due(last, T_odom_base)

    @property
    def is_label_due(self) -> bool:
        """Whether the policy requires a label for the next keyframe of a drive."""
        since = max(0, len(self.keyframes) + 1 - self.policy.labelled_every)
        return all(seen.top_two_classes is None for seen in self.keyframes.observations[since:])

    def localise(self, frame: Frame) -> LocalisedFrame:
        """Remove isolated returns from a new frame and localise it; LostError if its pose is unknown."""
        with self.stopwatch("localisation"):
            return self.localisation.localise(self.clean(frame))

    def clean(self, frame: Frame) -> Frame:
        """A copy of the frame without isolated returns."""
        return remove_isolated_returns(frame)

    def add_frame(self, localised: LocalisedFrame, labelled: bool | None = None, set_down: bool = False) -> Keyframe:
        """Make the newest frame a keyframe: add it to every map except the topological map.

        An unlabelled frame is not added to the semantic map and the segments. The people and objects in such a frame
        are added to the map with the next frame or correction.

        Args:
            localised: the result of :meth:`localise`.
            labelled: whether to label the keyframe; by default the policy decides.
            set_down: whether the robot has just been set down at this pose. Level ground is then assumed around and
                ahead of the robot until the ground is seen or the robot leaves, and classifiers get heights relative
                to this ground.

        Raises:
            InputError: the pose is so far from the other poses that the maps would take too much memory, or the
                classifier, the detector or a reader has given an invalid result. In this case, the frame has become
                a keyframe only if the detector or a reader gave the invalid result for this frame.
        """
        frame = localised.frame
        T_map_base = localised.T_map_base
        T_map_camera = localised.T_map_camera
        index = len(self.keyframes)
        labelled = self.is_label_due if labelled is None else labelled
        self._T_odom_keyframe = frame.T_odom_base
        if set_down:
            self._set_down = T_map_base
            self._start_height = float(T_map_base[2, 3])

        # A pose far away is refused before any map changes. The frame is added to the pose graph and to the keyframes
        # only after everything that may refuse it, so that both always have the same keyframes.
        self.elevation_map.cover(T_map_base[None, :3, 3])

        # Collect the detections in the last keyframe, and start the networks that find people and objects on this
        # one.
        self._add_detections()
        self._background.begin(frame, index, self.detector, self.readers)

        # Label the points, and thin the observations of this keyframe.
        points = frame.points(frame.T_base_camera)
        in_map = moved(T_map_base, points) if labelled else np.zeros((0, 3), np.float32)
        probabilities = None
        if labelled:
            with self.stopwatch("labels"):
                probabilities = self._classified(frame, in_map, T_map_camera)
        with self.stopwatch("keyframe"):
            stride = self.metric_map.stride(frame.intrinsics)
            voxel = self.semantic_map.config.voxel
            robot = self.elevation_map.robot
            seen = KeyframeObservation.of(
                frame, points, probabilities, stride, voxel, self.elevation_map.config, robot
            )

        # Occupied and free space, and the height of the ground.
        with self.stopwatch("metric_map"):
            seen.add_to_metric_map(self.metric_map, T_map_base)
        with self.stopwatch("elevation_map"):
            ground: list[GroundEvidence] = [*self._assumed_ground(frame, points, T_map_base), seen]
            for evidence in ground:
                evidence.add_to_elevation_map(self.elevation_map, T_map_base)

        # The pose graph, and the observations relative to the keyframe's pose.
        with self.stopwatch("localisation"):
            self.localisation.add(localised)
        self.keyframes.add(seen, T_map_base)
        for evidence in ground:
            self.keyframes.add_ground(index, evidence)

        # Classes, and the planes among the points of each class.
        labels = np.zeros(0, np.uint8)
        patches: list[PlanePatch] = []
        detections: list[Detection] = []
        if probabilities is not None:
            with self.stopwatch("semantic_map"):
                seen.add_to_semantic_map(self.semantic_map, T_map_base, index)
            labels = probabilities.argmax(axis=1).astype(np.uint8)
            with self.stopwatch("segments"):
                patches = find_planes(frame, labels, T_map_camera, self._seed + index, self.segments.config)
                self.segments.update(patches, index, T_map_base)

        # People and objects in a labelled frame. Observers hear of every keyframe, even if the detector has failed.
        try:
            if labelled:
                detections = self._add_detections()
        finally:
            keyframe = Keyframe(frame, T_map_base, in_map, labels, patches, detections, index)
            for observer in self.observers:
                observer.on_keyframe(keyframe)
        return keyframe

    def add_if_new(
        self, localised: LocalisedFrame, labelled: bool | None = None, set_down: bool = False
    ) -> Keyframe | None:
        """Make the newest frame a keyframe as :meth:`add_frame` does; None if it repeats an earlier keyframe."""
        if not localised.repeats:
            return self.add_frame(localised, labelled, set_down)
        self._T_odom_keyframe = localised.frame.T_odom_base
        self.localisation.continue_without_keyframe(localised)
        return None

    def _classified(self, frame: Frame, in_map: Points, T_map_camera: Pose) -> Probabilities:
        """Class probabilities of points; the classifier gets heights relative to where the robot was set down."""
        height = np.array([0.0, 0.0, self._start_height])
        T = T_map_camera.copy()
        T[:3, 3] -= height
        probabilities = self.classifier.classify(frame, in_map - height.astype(np.float32), T)
        check_probabilities(probabilities, len(in_map), self.classifier)
        return probabilities

    def add_drive(
        self, track: NDArray[np.float64], obstacles: NDArray[np.float32], touched: Sequence[NDArray[np.float64]]
    ) -> None:
        """Add the evidence of a drive to the elevation map; all coordinates are in ``map``, m.

        Each point is attached to the nearest keyframe since the previous drive, and moves with it.

        Args:
            track: (N, 3) successive x and y of ``base_link``, and headings, rad.
            obstacles: (M, 3) points on the obstacles that blocked the robot.
            touched: points that the robot touched, (K, 3) for each contact.
        """
        first, self._newest_at_drive = self._newest_at_drive, len(self.keyframes) - 1
        poses = self.keyframes.poses[first:]
        felt = np.vstack([np.zeros((0, 3)), *touched])
        near_track, near_obstacles, near_felt = (nearest_keyframes(p, poses) for p in (track, obstacles, felt))
        on_ground = np.column_stack([track[:, :2], poses[near_track, 2, 3]])
        for k, T in enumerate(poses):
            is_own = near_track == k
            own = on_ground[is_own], obstacles[near_obstacles == k], felt[near_felt == k]
            if any(map(len, own)):
                here, *met = (transform_points(inverse(T), points) for points in own)
                drive = DrivenTrack(here, (track[is_own, 2] - yaw_of(T)).astype(np.float32), *met)
                # This comes first, because it may raise InputError.
                drive.add_to_elevation_map(self.elevation_map, T)
                self.keyframes.add_ground(first + k, drive)

    def apply_corrections(self, only_if_due: bool = False) -> Moves | None:
        """Correct the keyframes of the localisation, and all maps with them; return None if the maps are unchanged.

        People and objects in the last keyframe of a drive are added to the map too. ``only_if_due``: whether to leave
        the maps unchanged until a correction is due.
        """
        if not len(self.keyframes):
            return None
        self._add_detections()
        with self.stopwatch("pose_graph"):
            self.localisation.optimise()
        poses = self.localisation.poses
        if (
            only_if_due
            and self.keyframes.moves_to(poses).max_displacements.max() <= self.config.keyframes.correction_threshold
        ):
            return None
        moves = self.correct(poses)
        if not moves.are_noticeable.any():
            return None
        for observer in self.observers:
            observer.on_correction(moves)
        return moves

    def correct(self, T_map_base: NDArray[np.float64]) -> Moves:
        """Rebuild the maps where keyframes move, as if all keyframes had always had their new (K, 4, 4) poses.

        Keyframes whose move is not noticeable stay. Everything anchored to a keyframe moves with it. The next
        :meth:`update_topological_map` fits the nodes of the topological map to the ground.

        Raises:
            InputError: the argument is not one rigid pose for each keyframe. The maps are unchanged.
        """
        before = self.keyframes.boxes()
        moves = self.keyframes.apply_poses(T_map_base)
        moving = moves.are_noticeable
        if moving.any():
            with self.stopwatch("correction"):
                self._rebuild(moving, np.concatenate([before[moving], self.keyframes.boxes()[moving]]))
        self.revise_labels()
        return moves

    def _rebuild(self, moving: NDArray[np.bool_], boxes: NDArray[np.float64]) -> None:
        """Rebuild the maps from the keyframes within boxes (M, 2, 3), m; ``moving`` (K,): which keyframes moved."""
        poses = self.keyframes.poses
        # Threads help here, because the kernels release the GIL.
        with ThreadPoolExecutor(1) as other:
            metric_map = other.submit(self._rebuild_metric_map, boxes)
            semantic_map = other.submit(self._rebuild_semantic_map, moving, boxes)
            with self.stopwatch("correction_elevation_map"):
                self._rebuild_elevation_map(boxes)
            metric_map.result()
            with self.stopwatch("correction_segments"):
                self.segments.rebuild(poses)
            semantic_map.result()
        with self.stopwatch("correction_victims"):
            self.victims.apply_poses(poses)
            self.finds.apply_poses(poses)
        with self.stopwatch("correction_topological_map"):
            self.topological_map.apply_poses(poses, moving)

    def _rebuild_metric_map(self, boxes: NDArray[np.float64]) -> None:
        keyframes = self.keyframes
        with self.stopwatch("correction_metric_map"), self.metric_map.rebuilding(boxes) as meets:
            for k in np.flatnonzero(meets(keyframes.boxes())):
                keyframes.observations[k].add_to_metric_map(self.metric_map, keyframes.poses[k])

    def _rebuild_semantic_map(self, moving: NDArray[np.bool_], boxes: NDArray[np.float64]) -> None:
        keyframes = self.keyframes
        if not any(keyframes.observations[k].top_two_classes for k in np.flatnonzero(moving)):
            return
        with self.stopwatch("correction_semantic_map"), self.semantic_map.rebuilding(boxes) as meets:
            for k in np.flatnonzero(meets(keyframes.boxes())):
                keyframes.observations[k].add_to_semantic_map(self.semantic_map, keyframes.poses[k], int(k))

    def _rebuild_elevation_map(self, boxes: NDArray[np.float64]) -> None:
        keyframes = self.keyframes
        with self.elevation_map.rebuilding(boxes) as meets:
            is_met = meets(keyframes.boxes())
            for k, evidence in keyframes.ground_evidence:
                if is_met[k]:
                    evidence.add_to_elevation_map(self.elevation_map, keyframes.poses[k])

    def _assumed_ground(self, frame: Frame, points: NDArray[np.float32], T_map_base: Pose) -> Sequence[AssumedGround]:
        """The ground near a new keyframe that is assumed to be level while the robot stands where it was set down.

        ``points``: the frame's returns in ``base_link``, m.
        """
        if self._set_down is None:
            return ()
        T_base_start = inverse(T_map_base) @ self._set_down
        if np.linalg.norm(T_base_start[:2, 3]) > START_RADIUS:
            self._set_down = None
            return ()
        robot, config = self.elevation_map.robot, self.elevation_map.config
        under = AssumedGround.under(T_base_start, robot, config)
        return under, AssumedGround.before(frame, points, robot, config)

    def update_topological_map(self, keyframe: Keyframe, paths: PosePaths | None = None) -> None:
        """Update the topological map with the planes of a keyframe and the ground that ``paths`` reach.

        ``paths``: the cheapest paths from the robot's position; by default they are computed.
        """
        if paths is None:
            T = keyframe.T_map_base
            paths = PosePaths(self.drivable, T[:2, 3], yaw_of(T))
        with self.stopwatch("topological_map"):
            self.topological_map.update(keyframe.patches, self.segments, paths)
            self.topological_map.anchor(self.keyframes.poses)
        self.revise_labels()

    def revise_labels(self) -> None:
        """Revise the labels of the semantic map according to the other maps, unless its classifier is certain."""
        if getattr(self.classifier, "is_certain", False):  # A user's own classifier may lack this attribute
            return
        keyframes = self.keyframes
        ground = self._traversability_layer.update(self.elevation_map)
        places = keyframes.poses[:, :3, 3]
        self.semantic_map.revise(
            Revision(ground, places, keyframes.highest_camera, self.finds.flat_find_points, self.people)
        )

    def _add_detections(self) -> list[Detection]:
        """Add the results of the background detection, if any, to the maps; return the people detected."""
        with self.stopwatch("reading"):
            read = self._background.end()
        if read is None or read.keyframe == len(self.keyframes):  # That frame was refused
            return []
        frame, T_map_base = read.frame, self.keyframes.poses[read.keyframe]
        with self.stopwatch("victims"):
            self.victims.update(frame, read.detections, T_map_base @ frame.T_base_camera, read.keyframe)
        with self.stopwatch("finds"):
            self.finds.update(frame, read.readings, T_map_base, read.keyframe)
        for observer in self.observers:
            observer.on_detections(read.keyframe, frame, read.detections)
        return read.detections


Check = Callable[[LocalisedFrame], ConfirmedPose | None]
"""Function that checks a pose. It returns the newest frame, whose pose is then certain, or None if the pose remains
in doubt."""


def sense_and_map(
    mapper: Mapper,
    sense: Callable[[], Frame],
    check: Check | None = None,
    labelled: bool | None = None,
    may_repeat: bool = False,
) -> Keyframe | None:
    """Sense, localise and map a frame (thesis 3.1 to 3.3), as for every frame of a robot or a recording.

    Args:
        mapper: holds all maps.
        sense: returns the newest frame.
        check: checks the pose; it may turn the robot for further frames, and reports whether the robot was set down.
            Without a check, every pose is trusted, and only the first frame shows where the robot was set down.
        labelled: whether to label the keyframe; by default the policy decides.
        may_repeat: whether to make a keyframe even if the frame repeats an earlier keyframe.

    Returns:
        The keyframe; None if the frame repeats an earlier keyframe, or if its pose is in doubt.

    Raises:
        LostError: the pose is unknown.
        InputError: see :meth:`Mapper.add_frame`.
    """
    # Sense.
    with mapper.stopwatch("sense"):
        frame = sense()
    # Localise: register the frame with the surfaces that earlier keyframes have seen.
    localised = mapper.localise(frame)
    # Check whether the map agrees with that pose.
    was_set_down = mapper.knows_camera and not len(mapper.keyframes)
    confirmed = ConfirmedPose(localised, was_set_down) if check is None else check(localised)
    if confirmed is None:
        return None
    # Map: add the frame to every map, unless it shows nothing new.
    add = mapper.add_frame if may_repeat else mapper.add_if_new
    return add(confirmed.localised, labelled, set_down=bool(confirmed.was_carried))
