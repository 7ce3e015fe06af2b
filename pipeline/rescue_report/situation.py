"""The robot's knowledge at the end of a run, summarised for a rescue team."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Labels, MaskLayer, Place, Places, Points, Poses
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.ground import Hazards, Unseen, find_hazards, find_unseen
from pipeline.rescue_report.routes import Route, Router
from pipeline.tracks.find import HEAT, Find
from pipeline.tracks.track import Track
from pipeline.transforms import wrap_angle, yaw_of
from pipeline.victims.display import confirmed_with_ids, ellipsoids, unconfirmed_with_ids

MAX_CHECKED_KEYFRAMES = 100
"""Maximum number of keyframes that are compared with the map, evenly spread over the run."""
OUTLIER_FRACTION = 0.01
"""Fraction of a person's points that is left out at either end of each dimension."""


@dataclass(frozen=True)
class BodySize:
    """A person's size.

    Attributes:
        length, width: horizontal sides of the smallest upright box around the person's points, the longer one first,
            m; outliers are left out.
        height: height of this box, m.
    """

    length: float
    width: float
    height: float

    @property
    def posture(self) -> str:
        """The posture in words; empty if the size does not determine it."""
        if self.length >= max(1.0, 2 * self.height):
            return "lying"
        if self.height >= max(0.6, self.length * 2 / 3):
            return "sitting, kneeling or leaning"
        return ""


def body_size_of(points: Points) -> BodySize:
    """The size of a person, from the person's points."""
    _, _, angle = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], np.float32))
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    sides = np.column_stack([points[:, :2] @ np.array([[c, -s], [s, c]]), points[:, 2]])
    low, high = np.quantile(sides, [OUTLIER_FRACTION, 1 - OUTLIER_FRACTION], axis=0)
    one, other, height = (high - low).tolist()
    return BodySize(max(one, other), min(one, other), height)


@dataclass(frozen=True, eq=False)
class Person:
    """A person whom the robot has seen.

    Attributes:
        display_id: a number if the person is confirmed, letters otherwise.
        victim: the person's track.
        body_size: the person's size.
        route: the path to the person; None if the robot cannot leave the entrance.
        is_warm: whether the person's heat was seen.
    """

    display_id: str
    victim: Track
    body_size: BodySize
    route: Route | None
    is_warm: bool = False

    @property
    def deviations(self) -> list[float]:
        """Standard deviations of the position along x, y and z, m."""
        return np.sqrt(np.diag(self.victim.covariance)).tolist()

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Semi-axes of the 95% confidence ellipse, m, the longer one first, and its yaw, rad."""
        (shorter, longer), directions = ellipsoids(self.victim.covariance[:2, :2])
        return float(longer), float(shorter), float(np.arctan2(directions[1, 1], directions[0, 1]))

    @property
    def direction_beyond_path(self) -> float:
        """Direction from the path's end to the person, rad to the left of the final heading; 0 without a path."""
        if self.route is None:
            return 0.0
        x, y = self.victim.position[:2] - self.route.end
        return wrap_angle(float(np.arctan2(y, x)) - self.route.heading)


@dataclass(frozen=True)
class Trust:
    """Evidence against the map, according to the robot's own data.

    Attributes:
        contradicted: fraction of the keyframes' depth that contradicts the map, which is built from all keyframes. If
            a wall is mapped twice, keyframes see through one copy, and see surfaces in front of the other.
        deviation: standard deviation of the least certain keyframe's position relative to the newest keyframe, m; 0
            for a robot that relies on its odometry alone.
        config: limits for these values.
    """

    contradicted: float
    deviation: float
    config: RescueReportConfig = RescueReportConfig()

    @property
    def is_consistent(self) -> bool:
        """Whether the map agrees with its keyframes."""
        return self.contradicted <= self.config.max_contradicted_fraction

    @property
    def is_certain(self) -> bool:
        """Whether every keyframe's position is certain enough."""
        return self.deviation <= self.config.deviation

    @property
    def is_good(self) -> bool:
        """Whether there is no evidence against the map."""
        return self.is_consistent and self.is_certain


def trust_in(mapper: Mapper, config: RescueReportConfig) -> Trust:
    """The evidence against a mapper's map from the keyframes and the localisation."""
    kept = list(zip(mapper.keyframes.observations, mapper.keyframes.poses, strict=True))
    checked = kept[:: 1 + len(kept) // MAX_CHECKED_KEYFRAMES]
    whole = Agreement.of(agreement(seen.frame, T @ seen.T_base_camera, mapper.metric_map) for seen, T in checked)
    slam = mapper.localisation
    deviations = slam.deviations if isinstance(slam, Slam) and len(slam.graph) else np.zeros(1)
    return Trust(1 - whole.explained_fraction, float(deviations.max()), config)


@dataclass(frozen=True, eq=False)
class Situation:
    """The content of the page, except the title, the date, the figures of the run, the scores and the settings.

    Attributes:
        poses: ``T_map_base`` of the run's keyframes; the first is the pose at which the robot was set down.
        traversability: traversability of the ground for the robot for which the paths are planned.
        is_seen: cells where the ground was measured, not merely assumed.
        points: points of the semantic map.
        labels: labels of these points.
        hazards: hazards on the ground that the robot can reach.
        unseen: ground that was not seen.
        people: confirmed people.
        unconfirmed_people: people who are not confirmed.
        finds: signs, codes, objects and heat; people's heat comes last.
        was_searched: whether a detector looked for people.
        end_reason: why exploration ended, as in report.json, or ``interrupted``; None if the robot did not explore,
            because it had goals or because somebody else moved the camera.
        viewpoints_left: viewpoints that were given up, because they are not worth the drive or because no path leads
            to them.
        trust: evidence against the map.
        can_leave: whether the robot's map has a path out of the entrance.
        knows_camera: whether the camera's pose on the robot was known, not merely estimated from a floor in view.
        config: parameters of the report.
    """

    poses: Poses
    traversability: Traversability
    is_seen: MaskLayer
    points: Points
    labels: Labels
    hazards: Hazards
    unseen: Unseen
    people: list[Person]
    unconfirmed_people: list[Person]
    finds: list[Find]
    was_searched: bool
    end_reason: str | None
    viewpoints_left: Sequence[Viewpoint]
    trust: Trust
    can_leave: bool
    knows_camera: bool
    config: RescueReportConfig

    @property
    def positions(self) -> Places:
        """(K, 2) m, x and y of the run's keyframes."""
        return self.poses[:, :2, 3]

    @property
    def has_finished(self) -> bool:
        """Whether the robot itself ended exploration, because no viewpoint worth the drive was left."""
        return self.end_reason in ("nothing_left", "not_worth_it")

    @property
    def is_explored(self) -> bool:
        """Whether the robot finished exploration, saw all places large enough for a person, and can trust its map."""
        knows_all = self.can_leave and self.unseen.seen_fraction is not None and not self.unseen.places
        return self.has_finished and knows_all and self.trust.is_good

    @property
    def others(self) -> list[Find]:
        """The finds except people's heat, which is reported with the people."""
        return [find for find in self.finds if not find.is_heat_of_person]

    @property
    def everyone(self) -> list[Person]:
        """All people, confirmed or not."""
        return [*self.people, *self.unconfirmed_people]

    @property
    def entrance(self) -> Place:
        """Position at which the robot was set down, x and y."""
        return self.poses[0, :2, 3]

    @property
    def entrance_yaw(self) -> float:
        """Heading with which the robot was set down, rad."""
        return yaw_of(self.poses[0])

    def from_entrance(self, position: Place) -> tuple[float, float]:
        """Distance of a position from the entrance, m, and its bearing relative to the entrance's heading, rad."""
        x, y = position[:2] - self.entrance
        return float(np.hypot(x, y)), float(np.arctan2(y, x)) - self.entrance_yaw


def situation_of(
    mapper: Mapper,
    camera_height: float,
    end_reason: str | None,
    viewpoints_left: Sequence[Viewpoint],
    config: RescueReportConfig,
) -> Situation:
    """The situation according to a mapper's maps.

    The maps need at least one keyframe of this run; the first keyframe of this run is at the entrance.

    Args:
        mapper: holds the maps and the victims; without a detector, people were not searched for.
        camera_height: height of the camera above the ground under the robot, m.
        end_reason: why exploration ended, see :attr:`Situation.end_reason`.
        viewpoints_left: viewpoints that were given up, see :attr:`Situation.viewpoints_left`.
        config: parameters of the report.
    """
    traversability = mapper.traversability
    measured = mapper.elevation_map.measured
    poses = mapper.keyframes.poses[mapper.keyframes.loaded_count :]
    paths = PosePaths(traversability, poses[0][:2, 3])
    points = mapper.semantic_map.points()
    # Paths start at all keyframes, because ground at the entrance or along the robot's trajectory may be unseen.
    reachable = PosePaths(traversability, poses[:, :2, 3]).reachable
    hazards = find_hazards(traversability, reachable, points, config)
    finds = mapper.finds.reported  # includes people's heat even if the robot does not look for other finds
    heat = [find.position for find in finds if find.is_heat_of_person and find.kind == HEAT]
    topology = mapper.topological_map
    router = Router(paths, topology, mapper.metric_map, hazards, yaw_of(poses[0]), camera_height, config)

    def person(display_id: str, victim: Track) -> Person:
        is_warm = any(np.array_equal(position, victim.position) for position in heat)
        return Person(display_id, victim, body_size_of(victim.points), router.to(victim.points), is_warm)

    return Situation(
        poses=poses,
        traversability=traversability,
        is_seen=~np.isnan(measured),
        points=points,
        labels=mapper.semantic_map.labels(),
        hazards=hazards,
        unseen=find_unseen(traversability, measured, reachable, config),
        people=[person(*found) for found in confirmed_with_ids(mapper.victims)],
        unconfirmed_people=[person(*found) for found in unconfirmed_with_ids(mapper.victims)],
        finds=finds if mapper.readers is not None else [],
        was_searched=mapper.detector is not None,
        end_reason=end_reason,
        viewpoints_left=viewpoints_left,
        trust=trust_in(mapper, config),
        can_leave=bool(paths.reachable.any()),
        knows_camera=mapper.knows_camera,
        config=config,
    )
