"""The whole pipeline: look, map, plan, drive (thesis, chapter 3)."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray

from pipeline.exploration.next_best_view import Exploration, Viewpoint
from pipeline.exploration.visibility import camera_view
from pipeline.frame import Frame
from pipeline.goals import Goals
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.metric_map.metric_map import MetricMap, MetricMapConfig
from pipeline.navigation.navigator import Halt, NavigationConfig, Navigator, Outcome
from pipeline.navigation.obstacle_check import ObstacleCheck, ObstacleCheckConfig
from pipeline.navigation.recovery import backtrack, escape
from pipeline.planning.path_plan import PathPlan, plan_path
from pipeline.robot import Robot
from pipeline.segments.planes import PlanesConfig, find_planes
from pipeline.segments.segments import Segments, SegmentsConfig
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.semantic_map import SemanticMap, SemanticMapConfig
from pipeline.stopwatch import Stopwatch
from pipeline.topological_map.topological_map import GraphKind, TopologicalMap
from pipeline.transforms import transform_points
from pipeline.traversability.depth_dropouts import find_depth_dropouts
from pipeline.traversability.elevation_map import ElevationMap
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability
from pipeline.traversability.traversability_layer import TraversabilityLayer
from pipeline.victims.detection.detection import Detection, Detector
from pipeline.victims.reobservation import Reobservation, ReobservationConfig
from pipeline.victims.victim_map import Victims, VictimsConfig

BUMPER, HALF_WIDTH, BODY_HEIGHT = 0.29, 0.25, 0.3
"""m from the robot's middle to what it touches with its front or back; half of its width; its height."""


@dataclass(frozen=True)
class ExplorerConfig:
    """The settings of every stage.

    Attributes:
        graph: what plans are made on: the thesis's minimum spanning tree, or the tree and the loops that shorten
            detours.
        start_radius: ground that is taken for flat around where the robot was set down until it is seen, m: whoever
            did so saw to that, and the camera sees nothing nearer than a metre.
        start_ahead: the same in a strip before the robot, m.
        start_width: of that strip, m.
        kidnapped: a robot that is elsewhere by this without having driven was set down anew, m.
        patience: drives that something ended since one last brought the robot further than ``kidnapped``, after
            which it stays.
    """

    metric_map: MetricMapConfig = field(default_factory=MetricMapConfig)
    semantic_map: SemanticMapConfig = field(default_factory=SemanticMapConfig)
    planes: PlanesConfig = field(default_factory=PlanesConfig)
    segments: SegmentsConfig = field(default_factory=SegmentsConfig)
    graph: Annotated[GraphKind, tyro.conf.arg(prefix_name=False)] = "roadmap"
    navigation: NavigationConfig = field(default_factory=NavigationConfig)
    obstacle_check: ObstacleCheckConfig = field(default_factory=ObstacleCheckConfig)
    victims: VictimsConfig = field(default_factory=VictimsConfig)
    reobservation: ReobservationConfig = field(default_factory=ReobservationConfig)
    start_radius: float = 0.5
    start_ahead: float = 1.4
    start_width: float = 0.8
    kidnapped: float = 0.3
    patience: int = 6


@dataclass(frozen=True, eq=False)
class Step:
    """What came of one look.

    Attributes:
        frame: what the camera saw.
        T_map_base: 4×4 pose of the robot at that moment, as localised.
        points: (N, 3) float32 the returns in ``map``.
        labels: (N,) uint8 their classes.
        detections: people in the image, before their depth was looked at.
        traversability: where the robot may drive now.
        viewpoint: where to go next; None if nothing is left to look at, or no goal to drive to.
        plan: the way there.
        can_drive: whether the robot stands where it can drive, and was not held again and again.
        was_kidnapped: whether the robot is elsewhere than it drove since the last look.
    """

    frame: Frame
    T_map_base: NDArray[np.float64]
    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    detections: list[Detection]
    traversability: Traversability
    viewpoint: Viewpoint | None
    plan: PathPlan | None
    can_drive: bool = True
    was_kidnapped: bool = False


def bumper(halt: Halt) -> NDArray[np.float64]:
    """(N, 3) points in ``map`` right before the end of the robot that was held, as high as its body."""
    ahead = BUMPER * np.sign(halt.command.v)
    points = [[ahead, left, BODY_HEIGHT] for left in np.linspace(-HALF_WIDTH, HALF_WIDTH, 21)]
    return transform_points(halt.T_map_base, np.array(points)).astype(np.float64)


class Explorer:
    """Explores with a robot: each ``step`` renews the maps and the plan, each ``drive`` follows the plan.

    With ``goals`` it drives to these, and explores only while no way is known to any that is left, and if it
    ``may_explore``. ``T_map_start`` (4×4) is where it looked first.
    """

    def __init__(
        self,
        robot: Robot,
        classifier: PointClassifier,
        config: ExplorerConfig | None = None,
        seed: int = 0,
        detector: Detector | None = None,
    ):
        """``detector``: of victims; without one nobody is looked for."""
        self.config = config or ExplorerConfig()
        self.robot = robot
        self.classifier = classifier
        self.detector = detector
        self.localisation = OdometryLocalisation()
        self.metric_map = MetricMap(self.config.metric_map)
        self.elevation_map = ElevationMap(robot.model)
        self.traversability_layer = TraversabilityLayer(robot.model)
        self.semantic_map = SemanticMap(self.config.semantic_map)
        self.segments = Segments(self.config.segments)
        self.topological_map = TopologicalMap(self.config.graph)
        self.exploration = Exploration(robot.model)
        self.victims = Victims(self.config.victims)
        self.reobservation = Reobservation(self.victims, self.metric_map, self.config.reobservation)
        self.exploration.rewards = self.reobservation
        self.goals: Goals | None = None
        self.may_explore = True
        self.navigator = Navigator(robot, self.config.navigation)
        self.stopwatch = Stopwatch()
        self.steps = 0
        self._times_held = 0
        self.T_map_start: NDArray[np.float64] | None = None
        self._T_map_last: NDArray[np.float64] | None = None
        self._track = np.zeros((0, 2))
        self._seed = seed

    def step(self) -> Step:
        """Sense, localise, map, segment, renew the topology and plan the way to the next view or goal."""
        with self.stopwatch("sense"):
            frame = self.robot.sense()
        with self.stopwatch("localisation"):
            T_map_base = self.localisation.localise(frame)
            T_map_camera = T_map_base @ frame.T_base_camera
            points = frame.points(T_map_camera)
            self.T_map_start = T_map_base if self.T_map_start is None else self.T_map_start
        with self.stopwatch("metric_map"):
            self.metric_map.integrate(frame.depth, frame.intrinsics, T_map_camera)
        with self.stopwatch("surface"):
            was_kidnapped = self._was_kidnapped(T_map_base)
            missing = find_depth_dropouts(frame.depth, frame.intrinsics, T_map_camera)
            traversability = self._update_surface(points, missing, T_map_base)
            out = escape(traversability, T_map_base, self._times_held > 0)
            paths = ShortestPaths(traversability, out)
        with self.stopwatch("semantic_map"):
            probabilities = self.classifier.classify(frame, points, T_map_camera)
            labels = probabilities.argmax(axis=1).astype(np.uint8)
            self.semantic_map.update(points, probabilities)
        with self.stopwatch("segments"):
            patches = find_planes(frame, labels, T_map_camera, self._seed + self.steps, self.config.planes)
            self.segments.update(patches, self.steps)
        detections = self._find_victims(frame, T_map_camera)
        with self.stopwatch("exploration"):
            viewpoint, back = self._next_view(frame, traversability, paths, T_map_base), None
            if viewpoint is None:
                viewpoint, paths, back = self._view_beyond(frame, traversability, paths, T_map_base)
            if viewpoint is not None:
                self.reobservation.aim(
                    traversability.on_ground(viewpoint.position[None])[0], viewpoint.heading
                )
        with self.stopwatch("topological_map"):
            self.topological_map.update(patches, self.segments, traversability, paths)
        with self.stopwatch("path_plan"):
            plan = self._plan(viewpoint, traversability, paths) if viewpoint else None
            first = out[None] if back is None else back
            if plan is not None and (first != T_map_base[:2, 3]).any():
                plan = plan.after(traversability.on_ground(first), T_map_base[:3, 3])
        self.steps += 1
        can_drive = paths.start is not None and not self.is_held
        return Step(
            frame,
            T_map_base,
            points,
            labels,
            detections,
            traversability,
            viewpoint,
            plan,
            can_drive,
            was_kidnapped,
        )

    def drive(self, step: Step) -> bool:
        """Follow the plan of a look and turn to its view; True if all of it was reached.

        The robot stops where something stands in its way that the map does not show: the next look plans anew.
        """
        if step.viewpoint is None or step.plan is None:
            return False
        self.navigator.T_map_odom = self.localisation.T_map_odom
        obstacle_check = ObstacleCheck(self._glance, step.traversability, self.config.obstacle_check)
        with self.stopwatch("navigation"):
            heading = step.viewpoint.heading if step.viewpoint.turn else None
            backs_up, start = self._backs_up(step, step.plan), step.T_map_base[:2, 3]
            reached = self.navigator.follow(
                step.plan.way_points, heading, backs_up, start, obstacle_check.is_clear
            )
        T_map_base, was_kidnapped = (
            self.navigator.T_map_base,
            self.navigator.legs[-1].outcome is Outcome.MOVED,
        )
        self._T_map_last = None if was_kidnapped else T_map_base
        came_away = np.linalg.norm(T_map_base[:2, 3] - step.T_map_base[:2, 3]) > self.config.kidnapped
        self._times_held = 0 if came_away else self._times_held + (not reached)
        self.elevation_map.update(obstacle_check.obstacles)
        track = np.array(self.navigator.track).reshape(-1, 2)
        self.elevation_map.add_track(track)
        self._track = np.vstack([self._track, track])
        for halt in self.navigator.halts:
            # An obstacle beside a robot that cannot leave would only shut it in.
            if halt.touches:
                self.elevation_map.add_obstacle(bumper(halt))
        return reached

    @property
    def is_held(self) -> bool:
        """Whether something ended drive after drive since the robot last got anywhere."""
        return self._times_held >= self.config.patience

    def _find_victims(self, frame: Frame, T_map_camera: NDArray[np.float64]) -> list[Detection]:
        """Detect people in the image and place them on the map."""
        if self.detector is None:
            return []
        with self.stopwatch("victims"):
            detections = self.detector.detect(frame.rgb)
            self.victims.update(frame, detections, T_map_camera)
            self.semantic_map.show_people([victim.points for victim in self.victims.confirmed])
            self.reobservation.count()
        return detections

    def _plan(
        self, viewpoint: Viewpoint, traversability: Traversability, paths: ShortestPaths
    ) -> PathPlan | None:
        """The way to a view, by the place where the robot has to turn for it."""
        if viewpoint.via is None:
            return plan_path(self.topological_map, traversability, paths, viewpoint.position)
        plan = plan_path(self.topological_map, traversability, paths, viewpoint.via)
        return plan and plan.on_to(traversability.on_ground(viewpoint.position[None]))

    def _backs_up(self, step: Step, plan: PathPlan) -> bool | None:
        """Whether to drive the last leg backwards; None, either will do, where the robot could not turn before it."""
        traversability, start = step.traversability, np.vstack([step.T_map_base[:3, 3], plan.way_points])[-2]
        can_turn = traversability.grid.at(traversability.turnable | traversability.slidable, start)
        return step.viewpoint.backwards if step.viewpoint is not None and can_turn else None

    def _next_view(
        self,
        frame: Frame,
        traversability: Traversability,
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> Viewpoint | None:
        """Where to go next: to a goal, or else to where much is to be seen; nowhere for a robot that is held."""
        if self.is_held:
            return None
        step = traversability, self.elevation_map.measured, paths, T_map_base
        viewpoint = self.goals.next_viewpoint(*step) if self.goals else None
        is_done = not self.may_explore or (self.goals is not None and not self.goals.left)
        if viewpoint or is_done:
            return viewpoint
        return self.exploration.next_viewpoint(*step, camera_view(frame, self.robot.model))

    def _view_beyond(
        self,
        frame: Frame,
        traversability: Traversability,
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
    ) -> tuple[Viewpoint | None, ShortestPaths, NDArray[np.float64] | None]:
        """Where to go next from where the robot came, the paths from there and the way back (N, 2), if there is one.

        Where nothing is left to see there either, the paths are those that lead further, for the map is made of them.
        """
        back = backtrack(traversability, paths, self._track)
        if back is None:
            return None, paths, None
        beyond, frontiers = ShortestPaths(traversability, back[-1]), self.exploration.frontiers
        viewpoint = self._next_view(frame, traversability, beyond, T_map_base)
        if viewpoint or beyond.reachable.sum() > paths.reachable.sum():
            return viewpoint, beyond, back
        self.exploration.frontiers = frontiers
        return None, paths, None

    def _glance(self) -> NDArray[np.float32]:
        """(N, 3) the returns that the camera has now, in ``map``."""
        frame = self.robot.sense()
        return frame.points(self.localisation.localise(frame) @ frame.T_base_camera)

    def _was_kidnapped(self, T_map_base: NDArray[np.float64]) -> bool:
        """Whether the robot is elsewhere than it drove; ground is promised wherever it is set down."""
        config, last, self._T_map_last = self.config, self._T_map_last, T_map_base
        set_down = last is None or bool(np.linalg.norm(T_map_base[:3, 3] - last[:3, 3]) > config.kidnapped)
        if set_down:
            self._track = np.zeros((0, 2))
            self.elevation_map.assume_ground(
                T_map_base, config.start_radius, config.start_ahead, config.start_width
            )
        return set_down and self.steps > 0

    def _update_surface(
        self, points: NDArray[np.float32], missing: NDArray[np.float32], T_map_base: NDArray[np.float64]
    ) -> Traversability:
        self.elevation_map.update(points, missing, T_map_base[:2, 3])
        return self.traversability_layer.update(self.elevation_map)
