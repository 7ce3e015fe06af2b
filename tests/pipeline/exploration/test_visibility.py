import numpy as np
import pytest

from pipeline.exploration import visibility
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.config import VisibilityConfig
from pipeline.exploration.visibility import ViewpointGains, camera_view
from pipeline.sensor import XTION
from pipeline.transforms import from_yaw
from tests.pipeline.exploration.asking import GUESSES
from tests.pipeline.still_robot import HEIGHT, INTRINSICS, PITCH, StillRobot

CAMERA = kernels.CameraView(0.6, 0.17, 0.9, 3.1, -0.6, 0.15, 0.9, 0.148, 180)
STRIDE = 5
SHAPE = (203, 101)


def terrain_with(known: np.ndarray, origin: tuple[float, float] = (0.0, 0.0)) -> kernels.SearchedTerrain:
    elevation = np.where(known, 0.0, np.nan).astype(np.float32)
    return kernels.SearchedTerrain(
        np.array(origin),
        0.05,
        elevation,
        np.zeros((*SHAPE, 2), np.float32),
        ~known,
        np.ones(SHAPE, np.float32),
        np.full((*SHAPE, 2), np.inf, np.float32),
        **GUESSES,
    )


def known_up_to(i: int) -> np.ndarray:
    known = np.zeros(SHAPE, np.bool_)
    known[:i] = True
    return known


def known_but_for_stripes() -> np.ndarray:
    """Ground with unknown stripes, so that every place has targets within reach."""
    known = known_up_to(203)
    known[2::40] = False
    return known


CELLS = np.argwhere(np.ones((20, 20), np.bool_)) * STRIDE


def fresh(cells: np.ndarray, terrain: kernels.SearchedTerrain) -> np.ndarray:
    return visibility.gains(terrain.origin + (cells + 0.5) * terrain.cell, CAMERA, terrain)


@pytest.fixture
def casts(monkeypatch):
    """Number of rays cast by each call."""
    numbers, cast = [], kernels.ray_gains

    def counted(places, camera, terrain, wanted, known):
        numbers.append(np.count_nonzero(wanted))
        return cast(places, camera, terrain, wanted, known)

    monkeypatch.setattr(kernels, "ray_gains", counted)
    return numbers


def test_what_is_kept_is_what_a_fresh_cast_gives():
    gains, rng = ViewpointGains(STRIDE), np.random.default_rng(0)
    known = known_up_to(60)
    for _ in range(6):
        i, j = rng.integers(0, SHAPE[0] - 20), rng.integers(0, SHAPE[1] - 20)
        known[i : i + 20, j : j + 20] = rng.random() < 0.7
        some = CELLS[rng.random(len(CELLS)) < 0.8]
        terrain = terrain_with(known.copy())
        np.testing.assert_array_equal(gains.at(some, CAMERA, terrain), fresh(some, terrain))


@pytest.fixture
def gains():
    """Gains with rays cast from all places over ground with unknown stripes."""
    gains = ViewpointGains(STRIDE)
    gains.at(CELLS, CAMERA, terrain_with(known_but_for_stripes()))
    return gains


def test_unchanged_ground_costs_nothing(casts, gains):
    gains.at(CELLS, CAMERA, terrain_with(known_but_for_stripes()))
    assert casts[0] > 0 and not any(casts[1:])


def test_no_ray_is_cast_where_nothing_in_reach_is_left_to_see(casts):
    ViewpointGains(STRIDE).at(CELLS, CAMERA, terrain_with(known_up_to(200)))
    assert casts == [0]


def test_a_change_concerns_only_what_sees_it(casts, gains):
    known = known_but_for_stripes()
    known[0, 0] = False
    gains.at(CELLS, CAMERA, terrain_with(known))
    assert 0 < casts[1] < casts[0] / 20


def test_rays_are_cast_anew_where_the_grid_begins_elsewhere_for_another_camera_and_for_other_guesses(casts, gains):
    terrain = terrain_with(known_but_for_stripes(), origin=(-6.4, 0.0))
    gains.at(CELLS, CAMERA, terrain)
    gains.at(CELLS, CAMERA._replace(height=0.5), terrain)
    gains.at(CELLS, CAMERA._replace(height=0.5), terrain._replace(falls=False))
    assert min(casts) > 0.95 * max(casts)


@pytest.mark.parametrize(("pitch", "height", "is_missed"), [(0.0, 0.0, True), (-0.5, 0.0, False), (0.0, 3.0, False)])
def test_a_keyframe_misses_only_what_the_camera_on_the_robot_as_it_was_could_see(pitch, height, is_missed):
    terrain = terrain_with(known_up_to(60))
    T = from_yaw(2.0, 2.5, height, 0.0)
    T[:3, :3] = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    misses, missed = np.zeros(SHAPE, np.uint8), np.zeros(256, np.int64)
    visibility.count_misses(T, CAMERA, terrain, misses, missed)
    assert misses.any() == missed.any() == is_missed


def test_a_view_is_that_of_the_camera_on_the_robot():
    view = camera_view(StillRobot().sense(), VisibilityConfig())
    assert (view.height, view.ahead) == (HEIGHT, 0.0)
    assert XTION.nearest < view.near < view.far < XTION.farthest
    half = np.arctan2(INTRINSICS.height / 2, INTRINSICS.fy)
    assert view.lower_edge == pytest.approx(-PITCH - half, abs=0.03)
    assert view.lower_edge > -PITCH - half
    assert view.upper_edge == pytest.approx(-PITCH + half, abs=0.03)
    assert view.upper_edge < -PITCH + half
    assert view.field_of_view == pytest.approx(2 * np.arctan2(INTRINSICS.width / 2, INTRINSICS.fx), abs=0.08)


def test_unknown_ground_is_no_likelier_than_unknown_ground_before_it_up_to_known_ground():
    terrain, ahead = terrain_with(known_up_to(100)), np.array([[4.0, 2.5]])
    sure = visibility.gains(ahead, CAMERA, terrain)[0, 0]
    terrain.probability[100:102] = 0.1
    assert visibility.gains(ahead, CAMERA, terrain)[0, 0] == pytest.approx(0.1 * sure)
    terrain.elevation[103:105] = 0.0
    assert visibility.gains(ahead, CAMERA, terrain)[0, 0] > 0.8 * sure


def test_what_did_not_show_from_farther_away_does_not_go_on_out_of_sight():
    """With the unknown ground's rim nearer than the camera sees."""
    terrain, ahead = terrain_with(known_up_to(100)), np.array([[4.8, 2.5]])
    sure = visibility.gains(ahead, CAMERA, terrain)[0, 0]
    terrain.probability[100:102] = 0.1
    assert visibility.gains(ahead, CAMERA, terrain)[0, 0] == pytest.approx(0.1 * sure)


def test_a_cell_is_missed_once_by_a_keyframe_and_again_only_by_one_from_elsewhere():
    terrain, poses = terrain_with(known_up_to(100)), np.stack([from_yaw(4.0, 2.5, 0, 0), from_yaw(4.05, 2.5, 0, 0)])
    misses, missed = np.zeros(SHAPE, np.uint8), np.zeros(256, np.int64)
    visibility.count_misses(poses[0], CAMERA, terrain, misses, missed)
    expected = visibility.cells_in_view(np.array([4.0, 2.5]), 0.0, CAMERA, terrain_with(known_up_to(100)))
    np.testing.assert_array_equal(misses, expected)
    visibility.count_misses(poses[1], CAMERA, terrain, misses, missed)
    assert misses.max() == 1  # too near to the first
    assert missed[0] == misses.sum()
    # From near, at a steep angle, as ground that falls away would show.
    visibility.count_misses(from_yaw(4.6, 2.5, 0, 0), CAMERA, terrain, misses, missed)
    assert misses.max() == 2
    assert missed[1] == (misses == 2).sum()


def room(size: float, angle: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A square room of ``size`` m with walls 0.1 m thick, turned by an angle: walls and what was seen of it."""
    x, y = (np.indices((400, 400)) - 199.5) * 0.05
    across = np.maximum(abs(x * np.cos(angle) + y * np.sin(angle)), abs(y * np.cos(angle) - x * np.sin(angle)))
    return (across > size / 2) & (across <= size / 2 + 0.1), across <= size / 2


@pytest.mark.parametrize("size", [2.0, 8.0])
def test_mean_free_path_is_pi_times_the_area_over_the_perimeter(size):
    mean = np.mean([visibility.mean_free_path(*room(size, angle), 0.05) for angle in np.linspace(0, np.pi / 2, 20)])

    assert mean == pytest.approx(np.pi * size**2 / (4 * size), rel=0.05)


def test_rays_are_expected_to_go_farther_in_a_hall_than_among_walls():
    config, nothing = VisibilityConfig(), np.zeros((400, 400), np.bool_)
    among_walls, hall, open_ground = (
        visibility.expected_sight_length(walls, seen, 0.05, config)
        for walls, seen in (room(1.2), room(12.0), (nothing, ~nothing))
    )

    assert among_walls == config.min_unknown_length < CAMERA.far < hall < open_ground
