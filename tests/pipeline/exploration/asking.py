"""How the tests ask an exploration for viewpoints, and its camera."""

from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.frontiers import find_frontiers
from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint, ViewpointRewards
from pipeline.exploration.visibility_kernels import CameraView
from pipeline.frame import Frame, Intrinsics
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import from_rotation, yaw_of
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

CAMERA = CameraView(
    height=0.6,
    ahead=0.17,
    near=0.9,
    far=3.1,
    lower_edge=np.deg2rad(-34),
    upper_edge=np.deg2rad(9),
    field_of_view=np.deg2rad(54),
    min_grazing_angle=np.deg2rad(8.5),
    rays=180,
)
"""An Xtion on the mast of a Pioneer, 12° down."""
GUESSES: dict[str, Any] = {
    "falls": True,
    "ramp_slope": 0.14,
    "nist_slope": 0.28,
    "max_unknown_length": 1.0,
    "level_run": 1.0,
    "min_new_view_distance": 0.3,
}
"""How unknown ground may go on, for a searched terrain."""


def frame() -> Frame:
    """An empty frame of that camera."""
    focal = 320 / np.tan(np.deg2rad(29)), 240 / np.tan(np.deg2rad(22.5))
    sin, cos = np.sin(np.deg2rad(12)), np.cos(np.deg2rad(12))
    R = np.array([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]])
    return Frame(
        time=0.0,
        rgb=np.zeros((480, 640, 3), np.uint8),
        depth=np.zeros((480, 640), np.float32),
        intrinsics=Intrinsics(640, 480, *focal, 320.0, 240.0),
        T_base_camera=from_rotation(R, [0.17, 0, 0.6]),
        T_odom_base=np.eye(4),
    )


_keyframes: WeakKeyDictionary[Strategy, np.ndarray] = WeakKeyDictionary()


def context(
    world: ElevationMap, pose: np.ndarray, earlier: np.ndarray | None = None, rewards: ViewpointRewards | None = None
) -> Context:
    """What a robot at a pose (4×4) knows, with ``earlier`` (K, 4, 4) keyframes."""
    traversability = assess_map(world)
    paths = PosePaths(traversability, pose[:2, 3], yaw_of(pose))
    poses = np.concatenate([np.zeros((0, 4, 4)) if earlier is None else earlier, pose[None]])
    return Context(frame(), pose, world.measured, paths, poses, rewards)


def correct(exploration: NextBestView, T_new_old: np.ndarray) -> None:
    """Move all keyframes so far by a 4×4 transform; the next step notices it."""
    _keyframes[exploration] = T_new_old @ _keyframes[exploration]


def next_viewpoint(
    exploration: Strategy, world: ElevationMap, pose: np.ndarray, rewards: ViewpointRewards | None = None
) -> Viewpoint | None:
    """One step: the viewpoint for which the robot sets out from a pose (4×4), where it has taken a keyframe."""
    here = context(world, pose, _keyframes.get(exploration), rewards)
    _keyframes[exploration] = here.poses
    exploration.observe(here)
    viewpoint = exploration.next_viewpoint(here)
    if viewpoint is not None:
        exploration.commit(viewpoint, here)
    return viewpoint


def frontiers(world: ElevationMap, pose: np.ndarray) -> np.ndarray:
    """(N, 3) the frontiers that a robot at a pose (4×4) finds."""
    here = context(world, pose)
    return find_frontiers(here)


def closed_room() -> ElevationMap:
    """4 m × 4 m of ground within walls."""
    corners = [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2)]
    return surface_of(ground_points(flat, (-2, 2), (-2, 2)), *(wall_points(a, b) for a, b in pairwise(corners)))


def corridor(west: float, east: float, half_width: float = 1.0, *, is_closed: bool = False) -> ElevationMap:
    """A corridor along x, open at its ends, or closed in the west."""
    world = surface_of(ground_points(flat, (west, east), (-half_width, half_width)))
    for y in (-half_width, half_width):
        world.update(wall_points((west, y), (east, y)))
    if is_closed:
        world.update(wall_points((west, -half_width), (west, half_width)))
    return world
