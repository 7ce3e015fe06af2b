"""Ways to people over ground with a known shape."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import assess_map
from pipeline.metric_map.metric_map import MetricMap
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.ground import find_hazards
from pipeline.rescue_report.routes import Route, Router, described_parts, straight_parts
from pipeline.topological_map.topological_map import TopologicalMap
from tests.pipeline.rescue_report.people import block
from tests.pipeline.still_robot import HEIGHT
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ridge, surface_of, wall_points

HALL = (-2.0, 2.0), (-1.0, 1.0)


def route(
    person: NDArray[np.float32], *clouds: NDArray[np.float32], start=(-1.5, 0.0), metric_map: MetricMap | None = None
) -> Route | None:
    traversability = assess_map(surface_of(*clouds))
    paths = PosePaths(traversability, start)
    hazards = find_hazards(traversability, paths.reachable, np.vstack(clouds), RescueReportConfig())
    metric_map = metric_map or MetricMap()
    router = Router(paths, TopologicalMap(), metric_map, hazards, 0.0, HEIGHT, RescueReportConfig())
    return router.to(person)


def test_straight_ahead_on_level_ground() -> None:
    way = route(block((1.5, 0, 0.2), (0.4, 0.4, 0.4)), ground_points(flat, *HALL))
    assert way is not None
    # It ends a little before what was seen of the person.
    assert way.length + way.distance_to_person == pytest.approx(2.8, abs=0.01)
    assert 0 < way.distance_to_person <= 0.1
    assert way.steepest == pytest.approx(0, abs=1e-4)
    assert way.drops == []
    assert way.arrives
    assert [leg.turn for leg in way.legs] == pytest.approx([0], abs=0.05)


def test_a_person_who_is_an_obstacle_keeps_the_robot_off() -> None:
    person = block((1.5, 0, 0.2), (0.4, 0.4, 0.4))
    way = route(person, ground_points(flat, *HALL), person)
    assert way is not None
    # 0.3 m from the cells of the obstacle, from the middle of one to that of another.
    assert 0.25 <= way.distance_to_person <= 0.4
    assert way.arrives


def test_over_a_ridge_the_ground_counts() -> None:
    way = route(block((1.5, 0, 0.1), (0.1, 0.1, 0.2)), ground_points(ridge, *HALL))
    assert way is not None
    level = np.linalg.norm(np.diff(way.waypoints[:, :2], axis=0), axis=1).sum()
    assert way.length - level == pytest.approx(2 * (np.hypot(RISE, RUN) - RUN), abs=0.01)
    assert way.steepest == pytest.approx(np.arctan(RISE / RUN), abs=0.01)


def test_no_person_is_reached_behind_a_wall() -> None:
    person = block((1.5, 0, 0.2), (0.4, 0.4, 0.4))
    wall = wall_points((0.5, -1), (0.5, 1))
    way = route(person, ground_points(flat, *HALL), wall)
    assert way is not None
    assert way.distance_to_person == pytest.approx(1.3 - 0.5 + 0.325, abs=0.06)
    assert not way.arrives


def test_a_wall_between_counts_however_near_the_person_is() -> None:
    person, wall = block((0.6, 0, 0.2), (0.1, 0.1, 0.4)), wall_points((0.3, -1), (0.3, 1))
    metric_map = MetricMap()
    for _ in range(5):
        metric_map.integrate_points(wall, [-1.0, 0, 0.6])
    ground = ground_points(flat, *HALL)
    through, along = route(person, ground, wall), route(person, ground, wall, metric_map=metric_map)
    assert through is not None
    assert along is not None
    assert through.is_in_sight and through.arrives
    assert not along.is_in_sight and not along.arrives
    assert along.distance_to_person < 0.7


def test_around_a_wall_there_are_bends() -> None:
    wall = wall_points((0, -1), (0, 0.3))
    way = route(block((1.0, -0.5, 0.2), (0.1, 0.1, 0.4)), ground_points(flat, *HALL), wall, start=(-1.0, -0.5))
    assert way is not None
    turns = [leg.turn for leg in way.legs]
    assert turns[0] > 0.3
    assert turns[-1] < -0.3
    assert sum(leg.length for leg in way.legs) == pytest.approx(way.length)


def test_drops_beside_the_way_are_named() -> None:
    def terrace(x: NDArray, y: NDArray) -> NDArray:
        return np.where(y > 0.5, -0.3, 0.0) + 0 * x

    way = route(block((1.5, 0, 0.2), (0.1, 0.1, 0.4)), ground_points(terrace, *HALL))
    assert way is not None
    assert [place.value for place in way.drops] == pytest.approx([0.3], abs=0.001)


def test_a_robot_that_cannot_leave_has_no_way() -> None:
    ground = ground_points(flat, *HALL)
    assert route(block((1, 0, 0.2), (0.1, 0.1, 0.4)), ground, start=(9.0, 9.0)) is None


def test_a_robot_that_stands_there_already_has_no_legs() -> None:
    way = route(block((-1.5, 0, 0.2), (0.2, 0.2, 0.4)), ground_points(flat, *HALL))
    assert way is not None
    assert way.length == pytest.approx(0, abs=0.11)
    assert way.arrives


def test_small_bends_make_no_parts() -> None:
    way = np.array([[0, 0], [1, 0], [1, 0], [2, 0.1], [2, 1]], float)
    parts = list(straight_parts(way, np.deg2rad(20)))
    assert [part.tolist() for part in parts] == [[[0, 0], [1, 0], [2, 0.1]], [[2, 0.1], [2, 1]]]
    assert list(straight_parts(way[1:3], np.deg2rad(20))) == []


@pytest.mark.parametrize(
    ("way", "lengths", "directions"),
    [
        ([(0, 0), (2, 0), (2, 0.1), (4, 2.1)], [2, 2.93], [0, 45]),  # a short part belongs to the next one
        ([(0, 0), (2, 0), (2, 1), (1.9, 1)], [2, 1.1], [0, 90]),  # but the last one to the one before
        ([(0, 0), (2, 0), (2, 0.1), (4, 0.1)], [4.1], [0]),  # what is straight on again is no direction
        ([(0, 0), (0.1, 0), (0.1, 0.15), (0.1, 0.15)], [0.25], [56]),  # short parts that together are not short
        ([(0, 0), (0.1, 0)], [0.1], [0]),  # a path that is short as a whole
    ],
)
def test_no_direction_is_shorter_than_can_be_followed(
    way: list[tuple[float, float]], lengths: list[float], directions: list[float]
) -> None:
    told = described_parts(np.array(way, float))
    assert [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for _, points in told] == pytest.approx(
        lengths, abs=0.01
    )
    first = [np.degrees(np.arctan2(*(line[1] - line[0])[::-1])) for line, _ in told]
    assert first == pytest.approx(directions, abs=1)


def test_directions_do_not_stand_still() -> None:
    assert described_parts(np.zeros((2, 2))) == []
