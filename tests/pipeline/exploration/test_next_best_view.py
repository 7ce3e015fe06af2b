from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.exploration import visibility
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.next_best_view import NextBestView
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import from_yaw, wrap_angle
from tests.pipeline.exploration.asking import (
    CAMERA,
    GUESSES,
    closed_room,
    context,
    correct,
    corridor,
    frontiers,
    next_viewpoint,
)
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RUN, flat, ground_points, ridge, surface_of, wall_points


def test_it_looks_where_the_known_ground_ends():
    world = corridor(-2, 2, is_closed=True)
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(0, 0, 0, np.pi))
    assert viewpoint is not None
    assert abs(viewpoint.heading) < np.deg2rad(30)
    assert viewpoint.gain > 0.5


def test_nothing_is_left_in_a_closed_room():
    exploration = NextBestView(PIONEER)
    assert next_viewpoint(exploration, closed_room(), from_yaw(0, 0, 0, 0)) is None
    assert len(frontiers(closed_room(), from_yaw(0, 0, 0, 0))) == 0


def test_walls_hide_what_lies_behind_them():
    world = closed_room()
    world.update(ground_points(flat, (4, 6), (-2, 2)))  # an island of known ground outside
    assert next_viewpoint(NextBestView(PIONEER), world, from_yaw(0, 0, 0, 0)) is None


def test_the_nearer_of_two_equal_openings_is_looked_at_first():
    world = corridor(-4, 2)
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(0.5, 0, 0, np.pi / 2))
    assert viewpoint.position[0] > -1
    assert abs(viewpoint.heading) < np.deg2rad(30)


def test_frontiers_are_where_reachable_ground_meets_the_unknown():
    world = corridor(-2, 2, is_closed=True)
    found = frontiers(world, from_yaw(0, 0, 0, 0))
    assert len(found) == 1
    np.testing.assert_allclose(found[0], (1.7, 0, 0), atol=0.2)


def test_ground_that_a_keyframe_missed_is_looked_for_from_elsewhere_and_then_given_up():
    world = corridor(-3, 1.5, is_closed=True)
    exploration = NextBestView(PIONEER)
    pose, viewpoints = from_yaw(0, 0, 0, np.pi), []
    for _ in range(100):
        viewpoint = next_viewpoint(exploration, world, pose)  # nothing new ever comes into view
        if viewpoint is None:
            break
        viewpoints.append(viewpoint.position)
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
    assert viewpoint is None
    assert np.ptp([v[0] for v in viewpoints]) > 0.3


def test_what_was_given_up_stays_so_when_the_map_moves():
    world, moved = (surface_of(ground_points(flat, (x - 1, x + 1), (-1, 1))) for x in (0.0, 0.5))
    exploration, pose, there = NextBestView(PIONEER), from_yaw(0, 0, 0, 0), from_yaw(0.5, 0, 0, 0)
    here = context(world, pose)
    for _ in range(200):
        if (viewpoint := next_viewpoint(exploration, world, pose)) is None:
            break
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
    assert viewpoint is None
    correct(exploration, there)
    moved.layers.match(here.traversability.grid)
    assert next_viewpoint(exploration, moved, there @ pose) is None
    assert next_viewpoint(NextBestView(PIONEER), moved, there @ pose) is not None


@pytest.mark.parametrize("seed", [*range(14), 1520, 4145])  # in the last two, the outermost rays matter
def test_cells_are_in_view_wherever_a_gain_is_expected(seed):
    """Also cells that only one ray reaches, with samples on the border of two cells, as every second one at 60°."""
    shape, camera = (140, 140), CAMERA
    pillars = np.random.default_rng(seed).random(shape) < 0.2  # few rays get through
    terrain = kernels.SearchedTerrain(
        origin=np.full(2, -3.5),
        cell=0.05,
        elevation=np.where(pillars, 3, 0).astype(np.float32),
        gradient=np.zeros((*shape, 2), np.float32),
        target=np.hypot(*(np.indices(shape) - 70)) > 45,
        probability=np.ones(shape, np.float32),
        missed_from=np.full((*shape, 2), np.inf, np.float32),
        **GUESSES,
    )
    place = np.array([0.025, 0.025])
    for m in np.flatnonzero(visibility.gains(place[None], camera, terrain)[0]):
        heading = wrap_angle(float(HEADING_ANGLES[m]))
        assert visibility.cells_in_view(place, heading, camera, terrain).any()


def test_from_a_ramp_it_without_room_it_looks_along_its_way_only():
    world = surface_of(ground_points(ridge, (-2.5, 0.05), (-0.5, 0.5)))
    for y in (-0.5, 0.5):
        world.update(wall_points((-2.5, y), (0.05, y)))
    world.update(wall_points((-2.5, -0.5), (-2.5, 0.5)))
    exploration, pose = NextBestView(PIONEER), from_yaw(-1.5, 0, 0, 0)
    for _ in range(20):  # what lies behind the crest is not seen from below it
        viewpoint = next_viewpoint(exploration, world, pose)
        if viewpoint is None or viewpoint.position[0] > -RUN - 0.25:
            break
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
    assert viewpoint is not None
    assert -RUN - 0.25 < viewpoint.position[0] < 0
    assert abs(viewpoint.heading) < np.deg2rad(2)


def ridge_seen_up_to_its_crest() -> ElevationMap:
    """A corridor over a ridge, seen only up to its crest."""
    world = surface_of(ground_points(ridge, (-4, 0.05), (-0.6, 0.6)), wall_points((-4, -0.6), (-4, 0.6)))
    for y in (-0.6, 0.6):
        world.update(wall_points((-4, y), (0.05, y)))
    return world


def test_behind_a_crest_it_looks_from_where_rays_do_not_graze_the_slope():
    viewpoint = next_viewpoint(NextBestView(PIONEER), ridge_seen_up_to_its_crest(), from_yaw(-3, 0, 0, 0))
    # A slope of 16° gives returns of rays that fall by at least 24.5°: these pass a crest of 0.17 m within 0.95 m of
    # the camera. From the ramp itself the camera looks up.
    assert -0.95 - 0.17 < viewpoint.position[0] < -RUN
    assert abs(viewpoint.heading) < np.deg2rad(25)


def test_behind_a_high_crest_from_where_no_falling_ground_would_show_it_looks_for_a_deck():
    world = surface_of(ground_points(lambda x, _: 0.36 + 0.28 * np.clip(x, -1.3, 0), (-4, 0.05), (-0.6, 0.6)))
    for a, b in pairwise([(2, -0.6), (-4, -0.6), (-4, 0.6), (2, 0.6)]):
        world.update(wall_points(a, b))
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(-3, 0, 0, 0))
    assert viewpoint is not None
    assert viewpoint.position[0] < 0
    assert abs(viewpoint.heading) < np.deg2rad(25)


def test_a_deck_that_may_follow_a_crest_ahead_is_looked_for_before_ground_far_away():
    world = surface_of(ground_points(lambda x, _: 0.36 + 0.28 * np.clip(x, -1.3, 0), (-12, 0.05), (-0.6, 0.6)))
    for y in (-0.6, 0.6):
        world.update(wall_points((-12, y), (2, y)))
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(-1, 0, 0, 0))
    assert viewpoint.position[0] > -2
    assert abs(viewpoint.heading) < np.deg2rad(25)


def test_no_ground_is_expected_twice_from_one_pose_whatever_follows_the_crest():
    world = surface_of(ground_points(lambda x, _: 0.36 + 0.28 * np.clip(x, -1.3, 0), (-12, 0.05), (-0.6, 0.6)))
    for y in (-0.6, 0.6):
        world.update(wall_points((-12, y), (2, y)))
    exploration = NextBestView(PIONEER)
    first = next_viewpoint(exploration, world, from_yaw(-1, 0, 0, 0))
    views = exploration.remaining.after(first).in_view(first)
    assert not np.any(views)


def test_ground_that_a_keyframe_missed_may_fall_away():
    deck = corridor(-3, 1, 0.6, is_closed=True)
    exploration = NextBestView(PIONEER)
    first = next_viewpoint(exploration, deck, from_yaw(-1, 0, 0, np.pi))
    second = next_viewpoint(exploration, deck, from_yaw(*first.position, 0, first.heading))
    assert first.position[0] < 0
    assert second.position[0] > 0.2


def test_where_it_cannot_turn_it_looks_as_it_stands():
    world = surface_of(ground_points(flat, (-0.33, 0.33), (-2, 2)))
    for x in (-0.33, 0.33):
        world.update(wall_points((x, -2), (x, 2)))
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(0, 0, 0, np.pi / 2))
    assert viewpoint is not None
    assert abs(np.sin(viewpoint.heading)) > 0.9


def test_no_view_from_where_the_robot_cannot_stand():
    world = surface_of(ground_points(flat, (0, 0.3), (0, 0.3)))
    assert next_viewpoint(NextBestView(PIONEER), world, from_yaw(0.1, 0.1, 0, 0)) is None


def test_the_choice_does_not_depend_on_chance():
    world = surface_of(ground_points(flat, (-2, 2), (-2, 2)))
    viewpoints = [next_viewpoint(NextBestView(PIONEER), world, from_yaw(0, 0, 0, 2.0)) for _ in range(2)]
    assert viewpoints[0].heading == viewpoints[1].heading
    np.testing.assert_array_equal(viewpoints[0].position, viewpoints[1].position)


def test_ground_taken_for_flat_in_a_small_room_is_seen_with_the_back_to_the_wall():
    world = ElevationMap(PIONEER)
    world.assume_ground(ground_points(flat, (-0.8, 0.8), (-0.8, 0.8)))
    corners = [(-0.6, -1.0), (0.6, -1.0), (0.6, 1.0), (-0.6, 1.0), (-0.6, -1.0)]
    seen = ground_points(flat, (-0.6, 0.6), (-1, 1))
    # From where the robot can turn, its camera sees nothing nearer than 1.04 m.
    seen = seen[np.abs(seen[:, 1] + 0.375) > 0.025]
    world.update(np.vstack([seen, *(wall_points(a, b) for a, b in pairwise(corners))]))
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(0, 0, 0, 0))
    assert viewpoint is not None
    away = np.array([0.0, -0.375]) - viewpoint.position
    assert away @ (np.cos(viewpoint.heading), np.sin(viewpoint.heading)) > 0


def test_ground_taken_for_flat_before_a_ramp_is_seen_by_backing_up_the_ramp():
    world = ElevationMap(PIONEER)
    world.assume_ground(ground_points(flat, (-2.1, -1.1), (-0.5, 0.5)))
    corners = [(-2.2, -0.6), (0.5, -0.6), (0.5, 0.6), (-2.2, 0.6), (-2.2, -0.6)]
    seen = ground_points(ridge, (-2.2, 0.5), (-0.6, 0.6))
    seen = seen[np.hypot(seen[:, 0] + 1.6, seen[:, 1]) > 0.3]
    world.update(np.vstack([seen, *(wall_points(a, b) for a, b in pairwise(corners))]))
    viewpoint = next_viewpoint(NextBestView(PIONEER), world, from_yaw(-1.6, 0, 0, 0))
    assert viewpoint is not None
    assert viewpoint.position[0] > -RUN
    assert abs(abs(viewpoint.heading) - np.pi) < np.deg2rad(30)


class Reward:
    """A reward for a keyframe along x from near (1, 0)."""

    def __init__(self, worth):
        self.wanted = ["keyframe"]
        self.worth = worth

    def gains(self, places, bearings):
        near = np.linalg.norm(places[:, :2] - (1, 0), axis=1) < 0.3
        return self.worth * near[:, None] * (np.cos(bearings) > np.cos(0.2))

    def aim(self, place, heading):
        self.aimed = place, heading


class RewardAnywhere(Reward):
    """The same small reward for every keyframe."""

    def gains(self, places, bearings):
        return np.full((len(places), len(bearings)), self.worth)


@pytest.mark.parametrize("worth", [0.0, 0.01])
def test_a_drive_ends_once_its_ground_is_shown_unless_its_keyframe_has_a_reward_too(worth):
    world, exploration = corridor(-2, 2), NextBestView(PIONEER)
    assert next_viewpoint(exploration, world, from_yaw(0, 0, 0, 0), RewardAnywhere(worth)) is not None
    assert not exploration.is_shown(world)
    world.update(ground_points(flat, (-9, 9), (-3, 3)))
    assert exploration.is_shown(world) == (worth == 0)


def test_a_reward_makes_a_viewpoint_worth_a_drive():
    exploration, reward, pose = NextBestView(PIONEER), Reward(1.0), from_yaw(0, 0, 0, 0)
    viewpoint = next_viewpoint(exploration, closed_room(), pose, reward)
    assert np.linalg.norm(viewpoint.position - (1, 0)) < 0.3
    assert abs(viewpoint.heading) < 0.2
    assert viewpoint.gain == pytest.approx(1.0)
    np.testing.assert_array_equal(reward.aimed[0], (*viewpoint.position, 0))
    reward.wanted = []
    assert next_viewpoint(exploration, closed_room(), pose, reward) is None


def test_it_is_weighed_with_the_ground_left_to_see():
    world = corridor(-4, 2)
    viewpoints = []
    for worth in (0.01, 100.0):
        pose = from_yaw(-2.5, 0, 0, np.pi / 2)
        viewpoints.append(next_viewpoint(NextBestView(PIONEER), world, pose, Reward(worth)))
    assert abs(viewpoints[0].heading) > 2  # the nearer end of the ground
    assert np.linalg.norm(viewpoints[1].position - (1, 0)) < 0.3


def test_what_is_left_comes_each_patch_once_and_stays_to_be_looked_for():
    world = corridor(-4, 2)
    exploration, here = NextBestView(PIONEER), context(world, from_yaw(0.5, 0, 0, np.pi / 2))
    exploration.observe(here)
    first, *others = exploration.leftovers(here)
    again = exploration.next_viewpoint(here)
    assert (first.gain, first.seconds, first.heading) == (again.gain, again.seconds, again.heading)
    assert any(np.cos(other.heading) * np.cos(first.heading) < 0 for other in others)  # the other end
    assert all(view.gain >= PIONEER.width * 0.05 for view in others)  # nothing smaller than a strip of that width
    exploration = NextBestView(PIONEER)
    here = context(closed_room(), from_yaw(0, 0, 0, 0), rewards=Reward(1.0))  # which is no ground
    exploration.observe(here)
    assert exploration.leftovers(here) == []
    assert exploration.next_viewpoint(here) is not None


def test_what_is_offered_begins_with_the_best_and_is_worth_the_drive():
    world = corridor(-4, 2)
    exploration, here = NextBestView(PIONEER), context(world, from_yaw(0.5, 0, 0, np.pi / 2))
    exploration.observe(here)
    best = exploration.next_viewpoint(here)
    offered = exploration.worthwhile_viewpoints(here, best, 32)
    assert offered[0] is best and exploration.worthwhile_viewpoints(here, best, 2)[1].gain == offered[1].gain
    assert {np.sign(np.cos(viewpoint.heading)) for viewpoint in offered} == {-1, 1}  # both ends
    assert all(viewpoint.gain >= exploration.required_gain(viewpoint.seconds) for viewpoint in offered)
    assert exploration.next_viewpoint(here).gain == best.gain  # nothing was changed


def test_what_a_drive_that_failed_on_its_way_should_have_shown_is_not_missed():
    world = corridor(-6, 2)
    exploration = NextBestView(PIONEER)
    first = next_viewpoint(exploration, world, from_yaw(-3, 0, 0, 0))
    there = from_yaw(*np.mean([first.position, (-3, 0)], axis=0), 0, first.heading)
    assert np.linalg.norm(first.position - (-3, 0)) > 4 * exploration.config.goal_tolerance
    anew = next_viewpoint(NextBestView(PIONEER), world, there)
    assert next_viewpoint(exploration, world, there).gain == anew.gain


def test_what_a_robot_that_arrived_with_another_heading_did_not_look_at_is_not_missed():
    world = corridor(-6, 2)
    exploration = NextBestView(PIONEER)
    first = next_viewpoint(exploration, world, from_yaw(-1, 0, 0, np.pi / 2))
    there = from_yaw(*first.position, 0, first.heading + np.pi)
    assert np.linalg.norm(first.position - (-1, 0)) > 4 * exploration.config.goal_tolerance
    again = next_viewpoint(exploration, world, there)
    anew = next_viewpoint(NextBestView(PIONEER), world, there)
    assert (again.gain, again.heading) == (anew.gain, anew.heading)


def test_a_robot_that_can_not_set_out_turns_to_something_else():
    world = corridor(-6, 2)
    exploration, pose = NextBestView(PIONEER), from_yaw(-1, 0, 0, np.pi / 2)
    first, second = (next_viewpoint(exploration, world, pose) for _ in range(2))
    assert first.position[0] > -1 > second.position[0]


def test_a_robot_that_finds_nothing_beyond_rims_expects_less_there_than_one_that_does():
    walls = [wall_points((-6, y), (6, y)) for y in (-1, 1)]
    end, more = (surface_of(ground_points(flat, (-6, x), (-1, 1)), *walls) for x in (2, 6))
    chances = []
    for known in (end, more):
        exploration, earlier = NextBestView(PIONEER), np.zeros((0, 4, 4))
        for x in (0.0, 0.6, 1.2):  # it drives up to a rim
            here = context(known if x else end, from_yaw(x, 0, 0, 0), earlier)
            exploration.observe(here)
            earlier = here.poses
        chances.append(exploration.sightings.visibility_probabilities)
    assert chances[0][0] == chances[1][0] == 1
    assert chances[0][1] < 1 / 3
    assert chances[1][1] > 2 / 3


def test_also_keyframes_on_the_way_show_where_no_ground_is():
    world = corridor(-6, 2)
    gains = []
    for on_the_way in ((), (0.5, 1.0)):
        poses = [from_yaw(x, 0, 0, 0) for x in on_the_way]
        here = context(world, from_yaw(-1, 0, 0, np.pi), np.array(poses).reshape(-1, 4, 4))
        exploration = NextBestView(PIONEER)
        exploration.observe(here)
        gains.append(sum(view.gain for view in exploration.leftovers(here) if view.position[0] > -1))
    assert gains[1] < 0.5 * gains[0]


def barred_corridor(beyond, half=0.1):
    """A corridor up to ``beyond`` m, seen but for a patch of twice ``half`` m behind a door just wide enough."""
    ground = ground_points(flat, (-3, beyond), (-1, 1))
    in_door = (np.abs(ground[:, 0] - 0.2) < half) & (np.abs(ground[:, 1]) < half)
    corners = [(-3, -1), (beyond, -1), (beyond, 1), (-3, 1), (-3, -1)]
    posts = [wall_points((0, side), (0, side / 2)) for side in (-1, 1)]
    return surface_of(ground[~in_door], *posts, *(wall_points(a, b) for a, b in pairwise(corners)))


@pytest.mark.parametrize(("beyond", "is_looked_at"), [(3.0, True), (0.5, False)])
def test_a_patch_that_is_not_worth_the_drive_is_looked_at_if_it_bars_the_way_to_other_ground(beyond, is_looked_at):
    world, exploration, pose = barred_corridor(beyond), NextBestView(PIONEER), from_yaw(-2.5, 0, 0, np.pi)
    here = context(world, pose)
    assert not here.paths.reachable[tuple(here.traversability.grid.cell_of(np.array([0.5, 0.0])))]
    viewpoint = next_viewpoint(exploration, world, pose)
    assert (viewpoint is not None) == is_looked_at
    if viewpoint is not None:
        assert viewpoint.gain < exploration.required_gain(viewpoint.seconds)
        assert viewpoint.position[0] < 0


@pytest.mark.parametrize("arrives", [True, False])
def test_a_patch_that_bars_a_way_is_looked_at_however_small_it_is_but_not_forever(arrives):
    exploration, world = NextBestView(PIONEER), barred_corridor(3.0, half=0.1)
    here, looks = context(world, from_yaw(-2.5, 0, 0, np.pi)), 0
    exploration.observe(here)
    while viewpoint := exploration.next_viewpoint(here):
        assert viewpoint.opens
        looks += 1
        assert looks < 10
        exploration.commit(viewpoint, here)
        if arrives:
            here = context(world, from_yaw(*viewpoint.position, 0, viewpoint.heading))
        exploration.observe(here)
    # A drive that ended elsewhere is no look.
    assert looks == (exploration.config.max_looks if arrives else exploration.config.max_drives_to_look)


def test_a_drive_to_a_view_of_what_bars_a_way_does_not_end_early():
    world, exploration = barred_corridor(3.0), NextBestView(PIONEER)
    viewpoint = next_viewpoint(exploration, world, from_yaw(-2.5, 0, 0, np.pi))
    assert viewpoint.opens
    assert viewpoint.stands
    world.update(ground_points(flat, (-3, 3), (-1, 1)))
    assert not exploration.is_shown(world)


@pytest.mark.parametrize("has_sill", [False, True])
def test_a_patch_is_not_looked_at_for_ground_that_something_else_bars_as_well(has_sill):
    world = barred_corridor(3.0)
    if has_sill:
        world.update(ground_points(lambda x, _: np.full_like(x, 0.15), (-0.1, 0), (-0.5, 0.5)))
    exploration = NextBestView(PIONEER)
    viewpoint = next_viewpoint(exploration, world, from_yaw(-2.5, 0, 0, np.pi))
    assert (viewpoint is None) == has_sill


@pytest.mark.parametrize("width", [0.2, 0.5])
def test_a_band_that_keeps_the_robot_off_both_sides_is_looked_at_as_what_bars_the_way(width):
    ground = ground_points(flat, (-3, 3), (-1, 1))
    band = (ground[:, 0] > 0.1) & (ground[:, 0] < 0.1 + width) & (np.abs(ground[:, 1]) < 0.7)
    corners = [(-3, -1), (3, -1), (3, 1), (-3, 1), (-3, -1)]
    world = surface_of(ground[~band], *(wall_points(a, b) for a, b in pairwise(corners)))
    exploration, pose, looks = NextBestView(PIONEER), from_yaw(-2, 0, 0, 0), 0
    for _ in range(30):
        viewpoint = next_viewpoint(exploration, world, pose)  # which shows nothing
        if viewpoint is None:
            break
        looks += viewpoint.opens
        pose = from_yaw(*viewpoint.position, 0, viewpoint.heading)
    assert viewpoint is None
    assert looks >= 3


@pytest.mark.parametrize("start", [(-1.2, 0.3, 0.0), (-0.5, 0.0, 0.0), (-0.5, -0.2, np.pi / 2)])
def test_what_bars_a_way_is_looked_at_from_where_the_camera_sees_all_of_it(start):
    world, exploration = barred_corridor(3.0), NextBestView(PIONEER)
    x, y, yaw = start
    view = next_viewpoint(exploration, world, from_yaw(x, y, 0, yaw))
    camera = view.position + CAMERA.ahead * np.array([np.cos(view.heading), np.sin(view.heading)])
    to_its_near_side = np.linalg.norm((0.1, 0.0) - camera)
    assert view.opens
    assert to_its_near_side > CAMERA.height / np.tan(-CAMERA.lower_edge) + 0.1


def test_what_is_given_up_says_why():
    exploration = NextBestView(PIONEER)
    pose = from_yaw(-2.5, 0, 0, np.pi)
    here = context(barred_corridor(3.0), pose)
    exploration.observe(here)
    (beyond,) = [view for view in exploration.leftovers(here) if not view.is_reachable]
    assert beyond.why == "unseen"
    assert beyond.position[0] > 0.2
    assert 2 < beyond.gain < 2.8 * 2  # the ground behind the door where the robot has room
    for sill, why in ((0.3, "no_way"), (None, "too_steep")):
        here = context(barred_by(sill), pose)
        exploration = NextBestView(PIONEER)
        exploration.observe(here)
        (beyond,) = [view for view in exploration.leftovers(here) if not view.is_reachable]
        assert beyond.why == why


def test_a_person_who_bars_the_only_way_is_named():
    corners = [(-3, -0.5), (3, -0.5), (3, 0.5), (-3, 0.5), (-3, -0.5)]
    walls = [wall_points(a, b) for a, b in pairwise(corners)]
    world = surface_of(ground_points(flat, (-3, 3), (-0.5, 0.5)), *walls)
    here = context(world, from_yaw(-2, 0, 0, 0))
    nowhere = np.zeros(world.grid.shape, np.bool_)
    ground = here.traversability.keeping_off(np.array([[0.0, 0.1, 0.02]]), nowhere)
    here = replace(here, paths=PosePaths(ground, (-2, 0), 0.0))
    exploration = NextBestView(PIONEER)
    exploration.observe(here)
    (beyond,) = [view for view in exploration.leftovers(here) if not view.is_reachable]
    assert beyond.why == "person"
    assert beyond.position[0] > 0


def barred_by(sill):
    """A corridor with a sill of this height, m, across it; without one, with a slope of 31° up to a deck."""

    def height(x, y):
        return np.where(np.abs(x) < 0.1, sill, 0.0) if sill else np.clip(0.6 * x, 0, 0.6)

    corners = [(-3, -1), (3, -1), (3, 1), (-3, 1), (-3, -1)]
    ground = ground_points(height, (-3, 3), (-1, 1))
    return surface_of(ground, *(wall_points(a, b) for a, b in pairwise(corners)))


def test_as_long_as_much_would_be_given_up_every_drive_is_worth_it():
    config = ExplorationConfig(min_ground_growth=2.0)  # no view is worth its time
    world, pose = corridor(-6, 2), from_yaw(0, 0, 0, 0)
    found = [
        next_viewpoint(NextBestView(PIONEER, config=replace(config, max_given_up_fraction=share)), world, pose)
        for share in (0.0, 1.0)
    ]
    assert found[0] is not None
    assert found[1] is None
