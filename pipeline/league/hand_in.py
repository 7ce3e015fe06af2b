"""Hand in a mission: the league's three files, from the files of a finished run."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.elevation_map.traversability import assess_map
from pipeline.errors import InputError
from pipeline.files import each, read_numbers
from pipeline.labels import COLOURS, Label
from pipeline.league.brief import HANDED_IN, MissionBrief
from pipeline.league.cloud import write_cloud
from pipeline.league.plan import draw_plan, searched_ground
from pipeline.league.pois import PointOfInterest, found_in, points_of_interest, write_pois
from pipeline.league.rules import LENGTHS
from pipeline.map_file import KEYFRAMES, load_elevation_map
from pipeline.metric_map.io.npz import load_metric_map
from pipeline.metric_map.io.plans import write_geotiff
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.semantic_map.ply import VERTEX, read_ply
from pipeline.transforms import from_rotation, from_yaw


def hand_in(folder: Path, brief: MissionBrief, robot: RobotModel) -> list[Path]:
    """Write ``handed_in/`` into the folder of a finished run; every file is tried, whatever fails in others.

    Args:
        folder: with trajectory_estimated.tum, metric_map.npz, keyframes.npz, and if they are there semantic_map.ply,
            finds.json and victims.json.
        brief: of the mission.
        robot: that drove.

    Returns:
        The files: 2D map, 3D map, list of finds.

    Raises:
        InputError: a file of the run is missing or damaged, or nothing can be written.
    """
    target = folder / HANDED_IN
    try:
        target.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{target}: {error.strerror or error}") from error
    path, T = _driven(folder, robot.half_length)
    cameras = path + np.array([0.0, 0.0, robot.headroom])
    metric_map = load_metric_map(folder / "metric_map.npz")
    pois = points_of_interest(found_in(folder), T, brief.start)
    names = (brief.plan_name, brief.cloud_name, brief.pois_name)
    plan, cloud, listed = files = [target / name for name in names]
    each(
        lambda: write_pois(listed, brief, pois),
        lambda: write_cloud(cloud, brief, *_surface(folder, metric_map), cameras, metric_map, T),
        lambda: _write_plan(plan, folder, robot, metric_map, T, path, pois),
    )
    return files


def league_frame(T_map_start: NDArray[np.float64], front: float) -> NDArray[np.float64]:
    """4×4 pose of the frame of the 3D map: level, on the floor ``front`` m before the robot's middle, y forward."""
    x, y, z = T_map_start[:3, 3]
    forward = T_map_start[:2, 0] / np.linalg.norm(T_map_start[:2, 0])
    x, y = (x, y) + front * forward
    return from_yaw(x, y, z, float(np.arctan2(-forward[0], forward[1])))


def _driven(folder: Path, front: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) m in ``map`` where the robot drove, and the league's frame by the first of its poses."""
    file = folder / "trajectory_estimated.tum"
    rows = read_numbers(file, "t x y z qx qy qz qw")
    if not len(rows):
        raise InputError(f"{file}: no pose")
    _, x, y, z, *quaternion = rows.T
    track, R = np.stack([x, y, z], axis=1), Rotation.from_quat([q[0] for q in quaternion])
    return track, league_frame(from_rotation(R.as_matrix(), track[0]), front)


def _surface(folder: Path, metric_map: MetricMap) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """(N, 3) points, m in ``map``, with colours (N, 3): of the semantic map, or else of occupied voxels."""
    file = folder / "semantic_map.ply"
    vertices = read_ply(file) if file.exists() else np.zeros(0, VERTEX)
    if not len(vertices):
        centres = metric_map.occupied_centres()
        return centres, np.tile(COLOURS[Label.UNLABELLED], (len(centres), 1))
    points, colours = (np.stack([vertices[name] for name in names], 1) for names in ("xyz", ("red", "green", "blue")))
    return points, colours


def _write_plan(
    file: Path,
    folder: Path,
    robot: RobotModel,
    metric_map: MetricMap,
    T_map_league: NDArray[np.float64],
    path: NDArray[np.float64],
    pois: list[PointOfInterest],
) -> None:
    """Draw and write the 2D map, georeferenced in the league's frame."""
    elevation_map, _ = load_elevation_map(folder / KEYFRAMES, robot)
    ground = searched_ground(assess_map(elevation_map), metric_map, path[:, :2])
    plan = draw_plan(file.name, ground, T_map_league, path, pois)
    write_geotiff(file, plan.image, LENGTHS["pixel"], plan.corner)
