"""The tour of a robot that knows the ground, on ground of the tests' own with rays that meet boxes."""

from dataclasses import replace
from itertools import pairwise
from math import inf

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.frame import Frame, Intrinsics
from pipeline.grid_map import Grid
from sarsim.ground_truth.true_surface import CELL, GroundTruthSurface
from sarsim.robots.model import drive_model, robot_model
from sarsim.scoring.oracle import Oracle, ViewpointDrive, min_seconds, true_traversability
from sarsim.scoring.sight import Sight

LENS = Intrinsics(640, 480, 570.0, 570.0, 320.0, 240.0)
HEIGHT = 0.6  # m of the camera
# Looks forward and 20° down.
DOWN = np.deg2rad(20)
T_BASE_CAMERA = np.array(
    [[0, -np.sin(DOWN), np.cos(DOWN), 0], [-1, 0, 0, 0], [0, -np.cos(DOWN), -np.sin(DOWN), HEIGHT], [0, 0, 0, 1]]
)


def oracle_in(length, width, start, wall=None, share=1.0):
    """An oracle in a room, m, whose corner is the origin, with a wall ((x, y), (x, y)), m, or none."""
    grid = Grid(np.array([-10, -10]), CELL, (round(length / CELL) + 20, round(width / CELL) + 20))
    x, y = np.moveaxis(grid.centre_of(np.moveaxis(np.indices(grid.shape), 0, -1)), -1, 0)
    floor = (x > 0) & (x < length) & (y > 0) & (y < width)
    to_wall = np.minimum(np.minimum(x, length - x), np.minimum(y, width - y))
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    boxes = [((0, 0, -0.1), (length, width, 0))]
    if wall:
        (a, b), (c, d) = wall
        inside = (x > a) & (x < c) & (y > b) & (y < d)
        floor &= ~inside
        to_wall = np.minimum(to_wall, grid.distance_to(inside))
        boxes.append(((a, b, 0), (c, d, 1)))
    for low, high in boxes:
        size = np.subtract(high, low)
        box = o3d.t.geometry.TriangleMesh.create_box(*size.tolist()).translate(np.array(low, np.float64))
        scene.add_triangles(box.vertex.positions.to(o3d.core.float32), box.triangle.indices.to(o3d.core.uint32))
    surface = GroundTruthSurface(
        grid, np.where(floor, 0.0, np.nan), floor & (to_wall > 0.3), np.zeros(grid.shape, np.bool_)
    )
    frame = Frame(0, np.zeros((0, 0, 3), np.uint8), np.zeros((0, 0), np.float32), LENS, T_BASE_CAMERA, np.eye(4))
    ground = true_traversability(surface, robot_model())
    return Oracle(ground, Sight(surface, ground, scene, frame), np.array(start), share, drive_model())


def test_in_a_corridor_all_ahead_shows_at_once_and_the_ground_behind_needs_a_drive():
    oracle = oracle_in(4.0, 1.2, (2.0, 0.6, 0.0))
    ahead = oracle.sight.cells[oracle.seen_at_start]
    assert (oracle.ground.grid.centre_of(ahead)[:, 0] > 2.0).all()
    tour = oracle.fastest
    assert tour.order
    assert 2.0 < tour.seconds < inf


def test_what_is_seen_at_the_start_takes_no_time_and_has_no_figures():
    oracle = oracle_in(4.0, 1.2, (2.0, 0.6, 0.0), share=0.05)
    assert oracle.fastest.seconds == 0
    assert oracle.figures() == {}


def test_a_keyframe_takes_no_time():
    oracle = oracle_in(4.0, 1.2, (2.0, 0.6, 0.0))
    assert oracle.seconds(1, [1]) == oracle.leg(1, 1).seconds == 0


def test_the_order_is_a_permutation_and_no_longer_than_the_greedy_one():
    oracle = oracle_in(4.0, 2.0, (1.0, 1.0, 0.0), wall=((1.9, 0.0), (2.1, 0.9)), share=0.95)
    cover = oracle.cover()
    order = oracle.ordered(cover)
    assert sorted(order) == sorted(cover)

    def seconds(way):
        return sum(oracle.seconds(a, [b])[0] for a, b in pairwise([0, *way]))

    assert seconds(order) <= seconds(cover)


def test_a_robot_is_compared_with_the_tour():
    oracle = oracle_in(4.0, 1.2, (2.0, 0.6, 0.0))
    tour = oracle.fastest
    assert oracle.ratios(2 * tour.metres, 3 * tour.seconds)["time_over_oracle"] == 3
    assert oracle.ratios(2 * tour.metres, 3 * tour.seconds)["time_over_physical"] > 3


def test_physics_allows_less_time_than_the_robots_own_planner_takes():
    oracle = oracle_in(4.0, 2.0, (1.0, 1.0, 0.0), wall=((1.9, 0.0), (2.1, 0.9)), share=0.95)
    figures, body = oracle.figures(), oracle.drive_model
    assert figures["oracle_path_m"] / body.top_speed < figures["physical_time_s"] < figures["oracle_time_s"]


BODY = replace(drive_model(), top_speed=1.0, top_turn_rate=2.0, acceleration=0.5)
"""Reaches its speed in 2 s and 1 m."""


def drive(*stops, backwards=None, first=0.0, last=0.0):
    back = np.zeros(len(stops) - 1, np.bool_) if backwards is None else np.array(backwards)
    return ViewpointDrive(np.array(stops, np.float64), back, first, last)


def test_a_straight_way_is_accelerated_on_and_not_braked_at_its_end():
    assert min_seconds([drive((0, 0), (5, 0))], BODY) == pytest.approx(2 + 4)
    assert min_seconds([drive((0, 0), (0.25, 0))], BODY) == pytest.approx(1)


def test_viewpoints_and_corners_are_passed_without_a_stop():
    legs = drive((0, 0), (2, 0)), drive((2, 0), (2, 3), last=np.pi / 2)
    assert min_seconds(legs, BODY) == pytest.approx(2 + 4)


def test_a_robot_that_reverses_stops():
    # 5 m in 2 + 3 + 2 s, and 3 m back in 2 + 2 s.
    legs = drive((0, 0), (5, 0)), drive((5, 0), (2, 0), backwards=[True])
    assert min_seconds(legs, BODY) == pytest.approx(7 + 4)
    # Too short to get to its speed: 0.5 m at 0.5 m/s² to 0.5 m/s and back, 1 s each.
    assert min_seconds([drive((0, 0), (0.5, 0), (0, 0), backwards=[False, True])], BODY) == pytest.approx(
        2 + np.sqrt(2)
    )


def test_turns_take_their_time_where_there_is_not_enough_driving():
    around = drive((0, 0), (0, 0), first=0.0, last=3.0)
    assert min_seconds([around], BODY) == pytest.approx(1.5)
    assert min_seconds([around, drive((0, 0), (0.25, 0), first=3.0)], BODY) == pytest.approx(3)


def test_who_has_seen_enough_at_once_needs_no_time():
    assert min_seconds([], BODY) == 0


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=8), st.data())
def test_the_time_is_that_at_top_speed_at_least_and_more_where_the_robot_stops(places, data):
    backwards = data.draw(st.lists(st.booleans(), min_size=len(places) - 1, max_size=len(places) - 1))
    body = replace(BODY, top_turn_rate=np.inf)
    straight, reversing = (min_seconds([drive(*places, backwards=b)], body) for b in (None, backwards))
    length = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    assert length / BODY.top_speed <= straight + 1e-9
    assert straight <= reversing + 1e-9
