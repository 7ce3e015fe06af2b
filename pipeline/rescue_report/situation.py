"""The robot's knowledge at the end of a run, as a rescue team needs it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Labels, MaskLayer, Place, Places, Points, Pose
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.mapper import Mapper
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.hazards import Hazards, find_hazards
from pipeline.rescue_report.posture import Posture, posture_of
from pipeline.rescue_report.routes import Route, Router
from pipeline.rescue_report.trust import Trust, trust_in
from pipeline.rescue_report.unseen import Unseen, find_unseen
from pipeline.robot import RobotModel
from pipeline.tracks.find import HEAT, Find
from pipeline.tracks.track import Track
from pipeline.transforms import wrap_angle, yaw_of
from pipeline.victims.certainty import ellipsoids
from pipeline.victims.display_ids import confirmed_ids, unconfirmed_ids


@dataclass(frozen=True, eq=False)
class Person:
    """A person whom the robot has seen.

    Attributes:
        display_id: a number if the person is confirmed, letters otherwise.
        victim: the person's track.
        posture: the person's size.
        route: the path to the person; None if the robot cannot leave the entrance.
        is_warm: whether the person's heat was seen.
    """

    display_id: str
    victim: Track
    posture: Posture
    route: Route | None
    is_warm: bool = False

    @property
    def deviations(self) -> list[float]:
        """Standard deviations of the position along x, y and z, m."""
        return np.sqrt(np.diag(self.victim.covariance)).tolist()

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Semi-axes of the 95 % confidence ellipse, m, the longer one first, and its yaw, rad."""
        (shorter, longer), directions = ellipsoids(self.victim.covariance[:2, :2])
        return float(longer), float(shorter), float(np.arctan2(directions[1, 1], directions[0, 1]))

    @property
    def beyond_way(self) -> float:
        """Direction from the path's end to the person, rad to the left of the path's last part; 0 without a path."""
        if self.route is None or len(self.route.way) < 2:
            return 0.0
        (x, y), (u, v) = np.diff(self.route.way[-2:, :2], axis=0)[0], self.victim.position[:2] - self.route.end
        return wrap_angle(float(np.arctan2(v, u) - np.arctan2(y, x)))


FINISHED = ("nothing_left", "not_worth_it")
"""Values of :attr:`Situation.ended` if the robot ended exploration by itself."""


@dataclass(frozen=True, eq=False)
class Situation:
    """The content of the page, except figures that need the ground truth.

    Attributes:
        robot: size and abilities of the robot for which the paths are planned.
        T_map_entrance: pose in which the robot was set down.
        positions: x and y of the run's keyframes.
        traversability: traversability of the ground.
        is_seen: cells where the ground was measured, not merely assumed.
        points: points of the semantic map.
        labels: labels of these points.
        hazards: hazards on the ground that the robot can reach.
        unseen: ground that was not seen.
        people: confirmed people.
        sightings: people who are not confirmed.
        finds: signs, codes, objects and heat; people's heat comes last.
        searched: whether a detector looked for people.
        ended: why exploration ended, as in report.json, or ``interrupted``; None without exploration: somebody else
            moved the camera, or the robot had goals.
        left: viewpoints that would have shown more ground but were not worth the drive.
        trust: how far the map can be trusted.
        can_leave: whether the robot's map has a path out of the entrance.
        knows_camera: whether the camera's pose on the robot was known, not merely measured from a floor in view.
        config: parameters of the report.
    """

    robot: RobotModel
    T_map_entrance: Pose
    positions: Places
    traversability: Traversability
    is_seen: MaskLayer
    points: Points
    labels: Labels
    hazards: Hazards
    unseen: Unseen
    people: list[Person]
    sightings: list[Person]
    finds: list[Find]
    searched: bool
    ended: str | None
    left: Sequence[Viewpoint]
    trust: Trust
    can_leave: bool
    knows_camera: bool
    config: RescueReportConfig

    @property
    def finished(self) -> bool:
        """Whether the robot ended exploration by itself, as no viewpoint was left that was worth the drive."""
        return self.ended in FINISHED

    @property
    def is_explored(self) -> bool:
        """Whether all ground to which the robot's map leads was seen, and the map can be trusted."""
        knows_all = self.can_leave and self.unseen.share is not None and not self.unseen.places
        return self.finished and knows_all and self.trust.is_good

    @property
    def others(self) -> list[Find]:
        """The finds except people's heat, which is reported with the people."""
        return [find for find in self.finds if not find.of_person]

    @property
    def everyone(self) -> list[Person]:
        """All people, confirmed or not."""
        return [*self.people, *self.sightings]

    @property
    def entrance(self) -> Place:
        """Position at which the robot was set down, x and y."""
        return self.T_map_entrance[:2, 3]

    @property
    def entrance_yaw(self) -> float:
        """Heading with which the robot was set down, rad."""
        return yaw_of(self.T_map_entrance)

    def from_entrance(self, position: Place) -> tuple[float, float]:
        """Distance of a position from the entrance, m, and its bearing relative to the entrance's heading, rad."""
        x, y = position[:2] - self.entrance
        return float(np.hypot(x, y)), float(np.arctan2(y, x)) - self.entrance_yaw


def situation_of(
    mapper: Mapper, camera_height: float, ended: str | None, left: Sequence[Viewpoint], config: RescueReportConfig
) -> Situation:
    """The situation according to a mapper's maps, with at least one keyframe of this run, the first at the entrance.

    Args:
        mapper: holds the maps and the victims; without a detector, people were not searched for.
        camera_height: height of the camera above the ground under the robot, m.
        ended: why exploration ended, see :attr:`Situation.ended`.
        left: viewpoints that would have shown more ground but were not worth the drive.
        config: parameters of the report.
    """
    traversability, measured = mapper.traversability, mapper.elevation_map.measured
    robot = traversability.robot
    poses = mapper.keyframes.poses[mapper.keyframes.loaded :]
    paths, points = PosePaths(traversability, poses[0][:2, 3]), mapper.semantic_map.points()
    # From all keyframes, because ground at the entrance, or from there to where the robot went, may be unseen.
    reachable = PosePaths(traversability, poses[:, :2, 3]).reachable
    hazards = find_hazards(traversability, reachable, points, robot, config.hazards)
    maps = traversability, paths, mapper.topological_map, mapper.metric_map
    finds = mapper.finds.reported
    router = Router(*maps, hazards, robot, yaw_of(poses[0]), camera_height, config.routes)
    return Situation(
        robot=robot,
        T_map_entrance=poses[0],
        positions=poses[:, :2, 3],
        traversability=traversability,
        is_seen=~np.isnan(measured),
        points=points,
        labels=mapper.semantic_map.labels(),
        hazards=hazards,
        unseen=find_unseen(traversability, measured, reachable, robot, config.unseen),
        people=[_person(*found, router, finds, config) for found in confirmed_ids(mapper.victims)],
        sightings=[_person(*found, router, finds, config) for found in unconfirmed_ids(mapper.victims)],
        finds=finds,
        searched=mapper.detector is not None,
        ended=ended,
        left=left,
        trust=trust_in(mapper, config.trust),
        can_leave=bool(paths.reachable.any()),
        knows_camera=mapper.knows_camera,
        config=config,
    )


def _person(
    display_id: str, victim: Track, router: Router, finds: Sequence[Find], config: RescueReportConfig
) -> Person:
    posture, heat = posture_of(victim.points, config.posture), [f for f in finds if f.of_person and f.kind == HEAT]
    is_warm = any(np.array_equal(find.position, victim.position) for find in heat)
    return Person(display_id, victim, posture, router.to(victim.points), is_warm)
