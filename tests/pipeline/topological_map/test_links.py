"""Which straight lines can be driven, and how long that takes."""

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.topological_map.node_set import StraightDrives, drive_seconds
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.topological_map.grounds import room
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ramp_and_deck, surface_of, wall_points

GAP = 0.15  # m between a line and a wall


def free(links: StraightDrives, a, b) -> bool:
    return bool(links.are_free(np.array([[*a, 0.0]]), np.array([[*b, 0.0]]))[0])


def links_over(*clouds) -> StraightDrives:
    return StraightDrives(assess_map(surface_of(*clouds)), [])


def test_the_whole_footprint_must_pass():
    traversability, segments = room((-2, 2), (-2, 2), [((0, -2), (0, -0.2)), ((0, 0.7), (0, 2))])
    links = StraightDrives(traversability, list(segments))
    assert free(links, (-1, 0.25), (1, 0.25))
    assert not free(links, (-1, 0.0), (1, 0.0))
    assert not free(links, (-1, -1), (1, -1))


def test_a_wall_that_only_the_semantic_map_knows_blocks_too():
    traversability, _ = room((-2, 2), (-2, 2), [])
    _, segments = room((-2, 2), (-2, 2), [((0, -2), (0, 0))])
    links = StraightDrives(traversability, list(segments))
    assert not free(links, (-1, -0.1), (1, -0.1))
    assert not free(links, (-1, 0.1), (1, 0.1))
    assert free(links, (-1, 0.3), (1, 0.3))
    assert StraightDrives(traversability, []).are_free(np.array([[-1, -1, 0.0]]), np.array([[1, -1, 0.0]]))[0]


def test_a_drop_a_step_and_a_low_ceiling_block():
    ground = ground_points(flat, (-2, 2), (-1, 1))
    assert free(links_over(ground), (-1, 0), (1, 0))
    drop = ground_points(lambda x, y: np.where(x > 0, -0.3, 0.0), (-2, 2), (-1, 1))
    assert not free(links_over(drop), (-1, 0), (1, 0))
    step = ground_points(lambda x, y: np.where(np.abs(x) < 0.3, 0.1, 0.0), (-2, 2), (-1, 1))
    assert not free(links_over(step), (-1, 0), (1, 0))
    for height, passes in ((0.5, False), (0.9, True)):
        ceiling = ground_points(lambda x, y, height=height: flat(x, y) + height, (-0.5, 0.5), (-1, 1))
        assert free(links_over(ground, ceiling), (-1.5, 0), (1.5, 0)) is passes


def test_a_ramp_is_driven_up_and_not_over_its_side():
    links = links_over(ground_points(ramp_and_deck, (-2, RUN + 1.5), (-2, 2)))
    assert free(links, (-1, 0), (RUN + 0.7, 0))
    assert not free(links, (0.3, -1.3), (0.3, 0))
    assert not free(links, (RUN + 0.7, -1.3), (RUN + 0.7, 0))


def test_a_metre_on_a_ramp_takes_longer():
    links = links_over(ground_points(ramp_and_deck, (-2, RUN + 1.5), (-2, 2)))
    level, ramp = drive_seconds(
        links.traversability, np.array([[-1.5, 0, 0], [-0.5, 0, 0]]), np.array([[-0.5, 0, 0], [RUN + 0.7, 0, RISE]])
    )
    assert level == pytest.approx(1.0 / PIONEER.speed + 1.5)
    length = RUN + 1.2
    assert length / PIONEER.speed * 1.3 < ramp - 1.5 < length / (0.65 * PIONEER.ramp_speed)


def test_no_lines_are_free_of_obstacles():
    links = links_over(ground_points(flat, (-1, 1), (-0.5, 0.5)))
    assert links.are_free(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_a_panel_beside_the_way_does_not_block_it():
    traversability, segments = room((-2, 2), (-1, 1), [((-1.5, 0.6), (1.5, 0.6))])
    assert free(StraightDrives(traversability, list(segments)), (-1.5, 0), (1.5, 0))
    near = wall_points((-1.5, 0.25), (1.5, 0.25))
    assert not free(links_over(ground_points(flat, (-2, 2), (-1, 1)), near), (-1.5, 0), (1.5, 0))
