"""Which objects a saved semantic map confuses with what, by casting its keyframes' rays from their true poses."""

from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial import KDTree

from pipeline.arrays import Mask, Poses
from pipeline.keyframes import Keyframes
from pipeline.labels import RAMP_TILT, Label
from pipeline.localisation.trajectory import read_trajectory
from pipeline.map_file import KEYFRAMES, read_keyframes
from pipeline.semantic_map.ply import read_ply
from sarsim.arenas.load import load_arena
from sarsim.commands.settings import load_settings
from sarsim.ground_truth.meshes import DRAWN_GROUPS
from sarsim.robots.model import robot_model
from sarsim.scoring.semantics import confusion_matrix, label_figures
from sarsim.sensors.camera import geom_labels
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result

SAME_POINT = 0.02  # m, maximum distance between a return and the map point made from it
SAME_POSE = 1e-5  # Tolerance between a keyframe's pose and its row in the trajectory, which has six decimals
NEAR_WALL = 0.1  # m; points nearer to a wall's points are counted separately
LEAST_SHARE = 1e-3  # Minimum share of all points for a row in the table


def confusion(folder: Path) -> Result:
    """True and given labels of the points of an episode's semantic map; the figures are IoU by label.

    Raises:
        InputError: the folder does not hold a complete episode, or its arena can no longer be loaded.
    """
    config = load_settings(EpisodeConfig, folder / "config.yaml")
    arena = load_arena(config.arena, config.start, config.random).mjcf_model
    model = mujoco.MjModel.from_xml_string(arena.to_xml_string(), arena.get_assets())
    keyframes = read_keyframes(folder / KEYFRAMES, robot_model(config.robot))
    returns, geoms, up = looked_again(model, keyframes, true_poses(folder, keyframes.poses))
    vertices = read_ply(folder / "semantic_map.ply")
    points = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    away, nearest = KDTree(returns).query(points, distance_upper_bound=SAME_POINT)
    known = np.isfinite(away)
    geom, labels = geoms[nearest[known]], geom_labels(model)
    truth, given = labels[geom], vertices["label"][known]
    names, near = [thing_of(model, g) for g in range(model.ngeom)], ("", ", near a wall")
    objects = [
        f"{names[g]}, {side_of(u)}{near[is_near]}"
        for g, u, is_near in zip(geom, up[nearest[known]], near_walls(points[known], truth).tolist(), strict=True)
    ]
    figures = label_figures(confusion_matrix(truth, given))
    iou = {f"iou.{name}": value for name, value in figures.pop("iou", {}).items()}
    rows = table(Counter(zip(truth.tolist(), objects, given.tolist(), strict=True)))
    rows.caption = ", ".join(f"{name} {value:.3f}" for name, value in iou.items())
    return Result(iou | figures, table=rows)


def true_poses(folder: Path, poses: NDArray[np.float64]) -> Poses:
    """(K, 4, 4) true poses of keyframes with estimated ``poses`` (K, 4, 4); NaN for those of an earlier episode."""
    estimated, true = (read_trajectory(folder / f"trajectory_{kind}.tum", False) for kind in ("estimated", "true"))
    away, row = KDTree(estimated.poses.reshape(-1, 16)).query(poses.reshape(-1, 16))
    return np.where((away < SAME_POSE)[:, None, None], true.poses[row], np.nan)


def looked_again(
    model: mujoco.MjModel, keyframes: Keyframes, true: Poses
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float64]]:
    """Find the geoms that the labelled returns of all keyframes come from.

    Args:
        model: the arena.
        keyframes: the keyframes, at their estimated poses.
        true: the keyframes' true poses; a keyframe with NaN is left out.

    Returns:
        (N, 3) returns in ``map``, m; (N,) ids of the first geoms on the rays to them from the true camera; and (N,)
        vertical components of the outward normals there. A return whose ray hits nothing is left out.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts = []
    for seen, T_map_base, T_world_base in zip(keyframes.seen, keyframes.poses, true, strict=True):
        if seen.shares is not None and np.isfinite(T_world_base).all():
            eye = (T_world_base @ seen.T_base_camera)[:3, 3]
            geom, up = first_hits(model, data, eye, seen.points_at(T_world_base) - eye)
            parts.append((seen.points_at(T_map_base)[geom >= 0], geom[geom >= 0], up[geom >= 0]))
    nothing = np.zeros((0, 3), np.float32), np.zeros(0, np.int32), np.zeros(0)
    returns, geoms, ups = (np.concatenate(part) for part in zip(nothing, *parts, strict=True))
    return returns, geoms, ups


def first_hits(
    model: mujoco.MjModel, data: mujoco.MjData, eye: NDArray[np.float64], rays: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(N,) ids of the first drawn geoms on rays (N, 3) from ``eye`` (3,), m, or -1; (N,) vertical normals."""
    size = len(rays)
    geom, distance, normal = np.full(size, -1, np.int32), np.zeros(size), np.zeros((size, 3))
    groups = np.isin(np.arange(mujoco.mjNGROUP), DRAWN_GROUPS).astype(np.uint8)
    mujoco.mj_multiRay(
        model, data, eye, rays.ravel(), groups, True, -1, geom, distance, normal.ravel(), size, mujoco.mjMAXVAL
    )
    return geom, normal[:, 2]


def near_walls(points: NDArray[np.float32], truth: NDArray[np.uint8]) -> Mask:
    """Which points (N, 3), m, with true labels (N,), are not walls but within ``NEAR_WALL`` of a wall's point."""
    is_wall = truth == Label.WALL
    near = np.zeros(len(points), np.bool_)
    if is_wall.any():
        away, _ = KDTree(points[is_wall]).query(points[~is_wall], distance_upper_bound=NEAR_WALL)
        near[~is_wall] = np.isfinite(away)
    return near


def thing_of(model: mujoco.MjModel, geom: int) -> str:
    """The element that a geom belongs to: the geom's name without the numbers that distinguish equal elements."""
    return str(model.geom(geom).name).rstrip("_0123456789") or "unnamed"


def side_of(up: float) -> str:
    """Whether a face is a top, bottom, slope or side, given the vertical component of its outward unit normal."""
    if abs(up) > np.cos(RAMP_TILT):
        return "top" if up > 0 else "bottom"
    return "side" if abs(up) < np.sin(RAMP_TILT) else "slope"


def table(pairs: Counter[tuple[int, str, int]]) -> Table:
    """Mislabelled points by true label, object and label in the map, most frequent first."""
    names, total = [label.name.lower() for label in Label], max(pairs.total(), 1)
    result = Table("is", "object", "taken for", title="semantic map")
    for name in ("points", "share"):
        result.add_column(name, justify="right")
    for (true, item, given), count in pairs.most_common():
        if true not in (given, Label.UNLABELLED) and count >= LEAST_SHARE * total:
            result.add_row(names[true], item, names[given], f"{count:,}", f"{count / total:.2%}")
    return result
