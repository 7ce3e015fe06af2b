"""Victims of known place and size, and the situation that an explorer before a wall is in with them."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from pipeline.explorer import Explorer
from pipeline.mapper import Mapper
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.situation import Situation, situation_of
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.tracks.find import Reading, box_corners
from pipeline.tracks.track import Observation, Track
from pipeline.victims.detection import Detection
from pipeline.victims.people import PeoplePolicy, PersonVoxels
from pipeline.victims.victim_map import Victims
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import HEIGHT, StillRobot


class BlindDetector:
    """A detector that finds no person: the people whom the robot knows are set by hand."""

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """Nothing."""
        return []


def block(
    middle: tuple[float, float, float], size: tuple[float, float, float], yaw: float = 0.0
) -> NDArray[np.float32]:
    """(N, 3) points that fill a box, about 3 cm apart."""
    sides = [np.linspace(-s / 2, s / 2, max(2, round(s / 0.03))) for s in size]
    x, y, z = (axis.ravel() for axis in np.meshgrid(*sides))
    c, s = np.cos(yaw), np.sin(yaw)
    return (np.column_stack([c * x - s * y, s * x + c * y, z]) + middle).astype(np.float32)


def victim(points: NDArray[np.float32], cameras: int = 2) -> Track:
    """A person seen from ``cameras`` places, one metre apart, with a standard deviation of 0.1 m."""
    photo = np.full((40, 30, 3), (200, 30, 30), np.uint8)
    reading, information = Reading("victim", "", box_corners((0, 0, 30, 40)), 0.9), np.eye(3) * 100
    places = [np.array([0.0, float(k), 0.6]) for k in range(cameras)]
    seen = [Observation(reading, k, points[0], information, place, points, photo) for k, place in enumerate(places)]
    track = Track(PeoplePolicy(), seen, list(seen))
    track.location = PeoplePolicy().body(PersonVoxels.of(points, 0.03), information, frozenset([0]))
    return track


def victims(*everyone: Track) -> Victims:
    """A victim map of these victims."""
    result = Victims()
    result.all = list(everyone)
    return result


def before_a_wall(found: Victims | None, *, end_reason: str | None = "nothing_left") -> Situation:
    """The robot has taken one keyframe, from the origin along x, of a floor and a wall 2.5 m away.

    Args:
        found: the people it knows; None if it has no detector.
        end_reason: why exploring ended.
    """
    mapper = mapped(has_detector=found is not None)
    mapper.victims = found or Victims()
    return situation_of(mapper, HEIGHT, end_reason, (), RescueReportConfig())


@cache
def mapped(*, has_detector: bool) -> Mapper:
    """The map after that keyframe."""
    mapper = Mapper(PIONEER, TruthClassifier(), BlindDetector() if has_detector else None)
    Explorer(StillRobot(), mapper).step()
    return mapper
