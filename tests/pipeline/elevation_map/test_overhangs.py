"""Thin level things that the robot cannot pass below: no space is free where they are, and no ground below."""

import numpy as np
import pytest

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.overhangs_kernels import Limits, _has_sill
from pipeline.elevation_map.traversability import Traversability, assess_map
from pipeline.frame import Frame, Intrinsics
from pipeline.keyframes import KeyframeObservation
from pipeline.metric_map.io.ros_map import LETHAL_COST, costs
from pipeline.metric_map.metric_map import MetricMap
from pipeline.sensor import XTION
from pipeline.transforms import from_rotation, from_yaw
from tests.pipeline.robot_model import PIONEER

CAMERA = Intrinsics(320, 240, 288.6, 289.7, 160.0, 120.0)
PITCH = np.radians(12)
T_BASE_CAMERA = from_rotation(
    np.array([[0, -np.sin(PITCH), np.cos(PITCH)], [-1, 0, 0], [0, -np.cos(PITCH), -np.sin(PITCH)]]), (0.17, 0, 0.6)
)
ROOM = [
    ((-3, -2.5, -0.1), (3, 2.5, 0)),
    *[((x - 0.05, -2.5, 0), (x + 0.05, 2.5, 1.2)) for x in (-3, 3)],
    *[((-3, y - 0.05, 0), (3, y + 0.05, 1.2)) for y in (-2.5, 2.5)],
]


def plate(top: float, thick: float, half_x: float, half_y: float) -> list:
    """A level plate on four legs in the middle of the room."""
    x, y = half_x - 0.05, half_y - 0.05
    legs = [((i * x - 0.02, j * y - 0.02, 0), (i * x + 0.02, j * y + 0.02, top)) for i in (-1, 1) for j in (-1, 1)]
    return [((-half_x, -half_y, top - thick), (half_x, half_y, top)), *legs]


def between_posts(bottom: float, top: float) -> list:
    """A bar or a half-closed shutter, 2.4 m wide."""
    posts = [((-0.05, y - 0.05, 0), (0.05, y + 0.05, 1.0)) for y in (-1.2, 1.2)]
    return [((-0.02, -1.2, bottom), (0.02, 1.2, top)), *posts]


CASES = {
    "table, 0.52 m": plate(0.515, 0.03, 0.8, 0.6),
    "table, 0.44 m": plate(0.435, 0.03, 0.8, 0.6),
    "table, 0.58 m, 2 cm thick": plate(0.58, 0.02, 0.8, 0.6),
    "table, 0.64 m": plate(0.635, 0.03, 0.8, 0.6),
    "table, 0.33 m, 1 cm thick": plate(0.33, 0.01, 0.8, 0.6),
    "bench": plate(0.45, 0.02, 0.6, 0.2),
    "seat": plate(0.42, 0.04, 0.25, 0.25),
    "bed": plate(0.25, 0.05, 1.0, 0.7),
    "shelf": plate(0.12, 0.02, 0.8, 0.5),
    "bar, 0.55 m": between_posts(0.535, 0.565),
    "bar, 0.3 m, 1 cm thick": between_posts(0.295, 0.305),
    "shutter": between_posts(0.4, 1.0),
}


def depth_of(boxes: list, T_map_camera: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(H, W) float32 m, as the Xtion measures boxes: none too near, too far or at a grazing angle, and with noise."""
    rays, origin = T_map_camera[:3, :3] @ CAMERA.rays.reshape(-1, 3).T, T_map_camera[:3, 3:]
    with np.errstate(divide="ignore"):
        inverse = 1 / rays
    depth, across = np.full(rays.shape[1], np.inf), np.zeros(rays.shape[1], np.int64)
    for low, high in np.array(boxes):
        with np.errstate(invalid="ignore"):
            faces = (low[:, None] - origin) * inverse, (high[:, None] - origin) * inverse
        enter, leave = np.minimum(*faces), np.maximum(*faces).min(axis=0)
        first = enter.max(axis=0)
        nearer = np.flatnonzero((first < leave) & (first > 0) & (first < depth))
        depth[nearer], across[nearer] = first[nearer], enter[:, nearer].argmax(axis=0)
    incidence = np.abs(rays[across, np.arange(rays.shape[1])]) / np.linalg.norm(rays, axis=0)
    returns = (depth > XTION.nearest) & (depth < XTION.farthest) & (incidence > np.sin(XTION.min_grazing_angle))
    noise = XTION.sigma(np.where(returns, depth, 1)) * rng.normal(size=len(depth))
    noisy = np.where(returns, depth + noise, 0)
    return noisy.reshape(CAMERA.height, CAMERA.width).astype(np.float32)


def mapped(boxes: list, poses: np.ndarray) -> tuple[MetricMap, Traversability]:
    """The maps of keyframes at poses."""
    metric_map, elevation_map, rng = MetricMap(), ElevationMap(PIONEER), np.random.default_rng(0)
    for T in poses:
        depth = depth_of(ROOM + boxes, T @ T_BASE_CAMERA, rng)
        frame = Frame(0.0, np.zeros((0, 0, 3), np.uint8), depth, CAMERA, T_BASE_CAMERA, T)
        config = elevation_map.config
        seen = KeyframeObservation.of(frame, frame.points(T_BASE_CAMERA), None, 2, 0.05, config, PIONEER)
        seen.add_to_metric_map(metric_map, T)
        seen.add_to_elevation_map(elevation_map, T)
    return metric_map, assess_map(elevation_map)


def poses_around(boxes: list, count: int = 24) -> np.ndarray:
    """Poses in the room that look more or less at the first of the boxes and keep clear of all."""
    rng, poses = np.random.default_rng(1), []
    reach = np.abs(np.array(boxes)[:, :, :2]).max(axis=(0, 1)) + 0.4
    while len(poses) < count:
        x, y = rng.uniform((-2.5, -2), (2.5, 2))
        if (np.abs((x, y)) > reach).any():
            poses.append(from_yaw(x, y, 0, np.arctan2(-y, -x) + rng.normal(0, 0.7)))
    return np.array(poses)


def cells_below(ground: Traversability, boxes: list) -> tuple[np.ndarray, ...]:
    (x0, y0, _), (x1, y1, _) = boxes[0]
    x, y = np.mgrid[x0 + 0.02 : x1 : 0.04, y0 + 0.02 : y1 : 0.04].reshape(2, -1)
    return tuple(ground.grid.cell_of(np.column_stack([x, y])).T)


def share_marked_free(metric_map: MetricMap, boxes: list) -> float:
    """Share of the voxels that hold a part of the first box."""
    axes = [np.arange(low + 0.005, high, 0.02) for low, high in np.array(boxes[0]).T]
    voxels = np.unique(metric_map.voxel_index(np.stack(np.meshgrid(*axes), -1).reshape(-1, 3)), axis=0)
    return float((metric_map.log_odds_at(voxels) < 0).mean())


@pytest.mark.parametrize("case", CASES)
def test_what_is_too_low_for_the_robot_bars_the_ground_below_it_and_stays_out_of_free_space(case: str) -> None:
    boxes = CASES[case]
    poses = poses_around(boxes)
    metric_map, ground = mapped(boxes, poses)
    cost = costs(ground, poses[:, :3, 3])[cells_below(ground, boxes)]
    assert not ((cost >= 0) & (cost < LETHAL_COST)).any()
    below = cells_below(ground, boxes)
    reachable = ground.traversable[below] & (np.abs(ground.elevation[below]) < 0.05)
    assert not reachable.any()
    # A plate at the camera's own height is seen from its edge alone: rays pass close above and below it.
    at_eye_level = abs(boxes[0][1][2] - 0.6) < 0.05
    assert share_marked_free(metric_map, boxes) <= (0.25 if at_eye_level else 0.03)


@pytest.mark.parametrize("gap", [0.0, 0.6])
def test_a_passage_without_anything_above_stays_open(gap: float) -> None:
    """The floor of the empty room, and a passage 0.6 m wide between two walls, 2 m long."""
    walls = [((-1, y0, 0), (1, y0 + 0.1, 1.2)) for y0 in (0.3, -0.4)] if gap else [((-2.9, 2.3, 0), (-2.8, 2.4, 1.2))]
    xs = np.linspace(-2.4, 0.5, 16)
    poses = np.array([*[from_yaw(x, 0, 0, 0) for x in xs], *[from_yaw(-x, 0, 0, np.pi) for x in xs]])
    _, ground = mapped(walls, poses)
    way = np.column_stack([np.linspace(-1, 1, 81), np.zeros(81)])
    assert ground.without_margin.traversable[tuple(ground.grid.cell_of(way).T)].all()


def test_ground_behind_an_overhang_is_free_once_it_is_seen_from_elsewhere() -> None:
    boxes = plate(0.515, 0.03, 0.3, 0.6)
    before = np.array([from_yaw(x, y, 0, 0) for x in (-2.2, -1.9, -1.6) for y in (-0.3, 0, 0.3)])
    beside = np.array([from_yaw(x, -1.1, 0, np.pi / 2) for x in np.arange(0.7, 1.2, 0.05)])
    place = np.array([[0.85, 0.1], [1.0, 0.1]])
    _, ground = mapped(boxes, before)
    assert np.isnan(ground.grid.at(ground.elevation, place)).all()
    _, ground = mapped(boxes, np.concatenate([before, beside]))
    assert np.isfinite(ground.grid.at(ground.elevation, place)).all()


def test_ground_seen_through_a_hole_in_a_wall_is_free() -> None:
    """The wall above the hole hides the space above that ground, but the wall also goes on below the hole."""
    low, high = 0.25, 0.55
    wall = [((-0.02, -2.4, 0), (0.02, 2.4, low)), ((-0.02, -2.4, high), (0.02, 2.4, 1.2))]
    wall += [((-0.02, y, low), (0.02, y + 2.0, high)) for y in (-2.4, 0.4)]
    poses = np.array([from_yaw(x, y, 0, 0) for x in (-1.6, -1.3, -1.0) for y in (-0.2, 0, 0.2)])
    _, ground = mapped(wall, poses)
    place = np.array([[0.7, 0.0], [0.9, 0.1]])
    assert np.isfinite(ground.grid.at(ground.elevation, place)).all()


def test_no_wall_is_sought_below_a_hole_by_a_camera_that_looks_straight_down() -> None:
    """The line above the ground is a point in its image, from which no direction leads down."""
    limits = Limits(0.65, 0.8, 3.5, 0.05, 2.0, 2, 0.05, 0.08)
    pinhole, down = np.array([100.0, 100.0, 50.0, 40.0]), np.array([0.0, 0.0, -1.0])
    depth = np.full((80, 100), 1.0, np.float32)
    assert not _has_sill(np.array([0.0, 0.0, 2.0]), 0.01, depth, pinhole, (50, 40), down, limits)
