"""The lidar: time per scan, scans per minute, labels compared with Open3D's, and KISS-ICP on the scans.

All times exclude waits for a processor that other programs use. Full scans, ray casts alone and depth images of the
same view are timed in turn.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import open3d as o3d
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import DataConfig, MappingConfig, RegistrationConfig
from kiss_icp.datasets.generic import GenericDataset
from kiss_icp.kiss_icp import KissICP
from kiss_icp.metrics import absolute_trajectory_error
from numpy.typing import NDArray

from pipeline.arrays import Indices
from pipeline.errors import InputError
from pipeline.processes import usable_cores
from pipeline.transforms import from_rotation
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import tracked
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene
from sarsim.ground_truth.meshes import drawn_geoms, joined_mesh
from sarsim.jobs import start_worker
from sarsim.plugins.lidar.config import PRESETS, LidarConfig
from sarsim.plugins.lidar.scanner import Scanner
from sarsim.plugins.lidar.semantic_kitti import sequence_folder
from sarsim.sensors.rendering import Renderer
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.dataset import make_scenes, undisturbed_seconds
from scripts.benchmarks.settings import LidarSettings

DEFAULT_SENSOR, DATASET_SENSOR = "vlp-16", "16x900"
SENSORS = (DATASET_SENSOR, "64x1024", *PRESETS)
IMAGE_SIZE = (64, 48)  # Width and height, pixels, of the datasets' camera images; small, because only scans are used
VIEW_ANGLE = 90.0  # degrees, the horizontal field of view of each depth image
KISS_ICP_RANGE = 20.0  # m, the maximum range passed to KISS-ICP, whose default voxel size is a hundredth of the range
EDGE_TOLERANCE = 1e-3  # m; a beam this close to an edge may hit either surface


def measure(settings: LidarSettings) -> Result:
    """Times of each sensor, agreement of the labels, throughput of two workers, and errors of KISS-ICP.

    Raises:
        InputError: a number is below 1, or there is no arena.
    """
    check_at_least(1, settings, "rounds", "scenes", "frames", "drive")
    if not settings.arenas:
        raise InputError("--arenas: give at least one arena")
    figures: dict[str, float] = {}
    robot = SimulatedRobot(load_arena(settings.arenas[0]), SimulationConfig(), settings.seed)
    for sensor in SENSORS:
        figures |= times(robot, sensor, settings.rounds)
    robot.close()
    for arena in settings.arenas:
        figures |= agreement(arena, settings.seed)
    figures |= throughput(settings)
    for arena in settings.arenas:
        for sensor in tracked(PRESETS, f"KISS-ICP in {arena}"):
            figures[f"kiss_icp.ate_m.{sensor}.{arena}"] = kiss_icp_error(sensor, arena, settings)
    figures["kiss_icp.ate_m"] = figures[f"kiss_icp.ate_m.{DEFAULT_SENSOR}.{settings.arenas[0]}"]
    return Result(figures)


def scanner_of(robot: SimulatedRobot, sensor: str, rng: np.random.Generator | None = None) -> Scanner:
    """The sensor on a robot."""
    model, data = robot.physics.model.ptr, robot.physics.data.ptr
    return Scanner(model, data, robot.base_body, LidarConfig(sensor).model(), rng)


def times(robot: SimulatedRobot, sensor: str, rounds: int) -> dict[str, float]:
    """Median time of a scan with errors and labels, ms, and its ratios to rays alone and to depth images."""
    scanner = scanner_of(robot, sensor, np.random.default_rng(0))
    model = LidarConfig(sensor).model()
    with Renderer(robot.physics.model.ptr, *image_size(sensor)) as renderer:
        contenders: list[Callable[[], object]] = [
            lambda: scanner.scan(0.0),
            rays_alone(robot, scanner, sensor),
            depth_images(robot, renderer, scanner, model.field_of_view),
        ]
        for contender in contenders:
            contender()
        took = np.array(
            [[undisturbed_time_of(contender) for contender in contenders] for _ in tracked(range(rounds), sensor)]
        )
    scan, rays, depth = np.median(took, axis=0)
    return {
        f"{sensor}.scan_ms": 1e3 * scan,
        f"{sensor}.over_rays": scan / rays,
        f"{sensor}.over_depth": scan / depth,
        f"{sensor}.beams": float(len(model.elevations) * model.columns),
    }


def undisturbed_time_of(action: Callable[[], object]) -> float:
    """Undisturbed time of a call, s."""
    start = undisturbed_seconds()
    action()
    return undisturbed_seconds() - start


def directions(sensor: str) -> NDArray[np.float64]:
    """(N, 3) unit vectors along the beams in the lidar's frame, row by row."""
    model = LidarConfig(sensor).model()
    up, around = np.meshgrid(np.radians(model.elevations), model.azimuths, indexing="ij")
    return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1).reshape(-1, 3)


def rays_alone(robot: SimulatedRobot, scanner: Scanner, sensor: str) -> Callable[[], object]:
    """A function that only casts MuJoCo's rays in the same directions, into existing buffers."""
    model, data, T = robot.physics.model.ptr, robot.physics.data.ptr, scanner.pose
    rays = (directions(sensor) @ T[:3, :3].T).ravel()
    count = len(rays) // 3
    geom, distance, normal = np.empty(count, np.int32), np.empty(count), np.empty(len(rays))
    groups, reach = np.array([1, 1, 1, 0, 0, 0], np.uint8), LidarConfig(sensor).model().range[1]
    place = T[:3, 3].copy()
    body = robot.base_body

    def cast() -> None:
        mujoco.mj_multiRay(model, data, place, rays, groups, True, body, geom, distance, normal, count, reach)

    return cast


def image_size(sensor: str) -> tuple[int, int]:
    """Width and height, pixels, of images that have the width ``VIEW_ANGLE`` and cover all rows of beams.

    The images have one column per column of beams.
    """
    model = LidarConfig(sensor).model()
    width = round(model.columns * VIEW_ANGLE / model.field_of_view)
    highest = np.radians(max(abs(angle) for angle in model.elevations))
    return width, max(16, round(width * np.tan(highest) / np.cos(np.radians(VIEW_ANGLE / 2))))


def depth_images(robot: SimulatedRobot, renderer: Renderer, scanner: Scanner, view: float) -> Callable[[], object]:
    """A function that renders depth and geom ids in images that cover the lidar's field of view, ``view`` degrees."""
    model, data = robot.physics.model.ptr, robot.physics.data.ptr
    model.vis.global_.fovy = 2 * np.degrees(
        np.arctan(np.tan(np.radians(VIEW_ANGLE / 2)) * renderer.height / renderer.width)
    )
    cameras = []
    for k in range(int(np.ceil(view / VIEW_ANGLE))):
        camera = mujoco.MjvCamera()
        camera.distance, camera.azimuth, camera.elevation = 1e-3, VIEW_ANGLE * k, 0.0
        camera.lookat[:] = scanner.pose[:3, 3]
        cameras.append(camera)

    def render() -> None:
        for camera in cameras:
            renderer.segmentation_and_depth(data, camera)

    return render


def agreement(arena: str, seed: int) -> dict[str, float]:
    """Fractions of the beams of ``64x1024`` with Open3D's label, and with another label far from any edge."""
    robot = SimulatedRobot(load_arena(arena), SimulationConfig(), seed)
    model, data = robot.physics.model.ptr, robot.physics.data.ptr
    scanner, rays = scanner_of(robot, "64x1024"), directions("64x1024")
    scan, columns = scanner.scan(0.0), LidarConfig("64x1024").model().columns
    is_robot = model.body_rootid[model.geom_bodyid] == model.body_rootid[robot.base_body]
    cast = open3d_caster(model, data, np.flatnonzero(drawn_geoms(model) & ~is_robot))
    label = np.append(model.geom_user[:, 0], -1)  # the last label belongs to no geom
    nearest = LidarConfig("64x1024").model().range[0]
    origin, world = scan.T_world_lidar[:3, 3], rays @ scan.T_world_lidar[:3, :3].T
    theirs, distance = cast(origin, world)
    theirs[distance < nearest] = -1
    ours = np.full(len(rays), -1)
    ours[scan.ring.astype(int) * columns + scan.column] = scan.instance
    wrong = np.flatnonzero(label[ours] != label[theirs])
    unexplained = np.ones(len(wrong), np.bool_)
    rng = np.random.default_rng(seed)
    for _ in range(64):
        offsets = (
            EDGE_TOLERANCE * rng.uniform(-1, 1, (len(wrong), 3)) / np.maximum(distance[wrong, None].clip(max=10), 0.1)
        )
        near, _ = cast(origin, world[wrong] + offsets)
        unexplained &= label[near] != label[ours[wrong]]
    robot.close()
    return {
        f"labels_equal.{arena}": 1 - len(wrong) / len(rays),
        f"labels_unexplained.{arena}": float(np.count_nonzero(unexplained)) / len(rays),
    }


def open3d_caster(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Indices
) -> Callable[[NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.int64], NDArray[np.float32]]]:
    """A function that casts (N, 3) rays from an origin with Open3D: (N,) geom ids, -1 for none, and distances, m."""
    scene = o3d.t.geometry.RaycastingScene()
    for geom in geoms:
        T = from_rotation(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
        mesh = joined_mesh(model, [int(geom)], [T])
        scene.add_triangles(*map(o3d.core.Tensor.from_numpy, (mesh.vertices, mesh.triangles)))

    def cast(origin: NDArray[np.float64], rays: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        lines = np.concatenate([np.tile(origin, (len(rays), 1)), rays], axis=1).astype(np.float32)
        hits = scene.cast_rays(o3d.core.Tensor.from_numpy(lines))
        number, distance = hits["geometry_ids"].numpy(), hits["t_hit"].numpy()
        return np.where(np.isfinite(distance), geoms[np.minimum(number, len(geoms) - 1)], -1), distance

    return cast


def throughput(settings: LidarSettings) -> dict[str, float]:
    """Scans per minute of two workers that make scenes in random arenas, including the writing of files."""
    sensor = {"lidar": LidarConfig(DATASET_SENSOR)}
    recipe = Recipe(
        seed=settings.seed, frames=settings.frames, width=IMAGE_SIZE[0], height=IMAGE_SIZE[1], plugins=sensor
    )
    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name, part) for part in "ab"]
        for folder in folders:
            folder.mkdir()
        workers = [start_worker(make_scenes, recipe, folder) for folder in folders]
        each = max(settings.scenes // 2, 1)
        took, start = np.zeros(2), time.perf_counter()
        for index in tracked(range(1 + each), "scenes of each worker"):
            for number, (_, connection) in enumerate(workers):
                connection.send(2 * index + number)
            took += [connection.recv() for _, connection in workers]
            if not index:  # the first scene includes the imports
                took[:], start = 0.0, time.perf_counter()
        clock = time.perf_counter() - start
        for process, _ in workers:
            process.kill()
            process.join()
    scans = 2 * each * settings.frames
    # With fewer than two processors, the workers wait for each other, and this time must be included.
    undisturbed = float(took.max()) if usable_cores() >= 2 else clock
    per_minute = 60 * scans / undisturbed
    return {
        "scans": float(scans),
        "scans_per_minute": per_minute,
        "scans_per_minute.by_the_clock": 60 * scans / clock,
        "minutes_for_100000": 1e5 / per_minute,
    }


def kiss_icp_error(sensor: str, arena: str, settings: LidarSettings) -> float:
    """ATE, m, of KISS-ICP on a drive's scans from a dataset, after alignment, by KISS-ICP's own metric."""
    recipe = Recipe(
        seed=settings.seed,
        frames=settings.drive,
        width=IMAGE_SIZE[0],
        height=IMAGE_SIZE[1],
        arenas=(arena,),
        frames_per_second=LidarConfig("vlp-16").model().rate,
        plugins={"lidar": LidarConfig(sensor)},
    )
    with tempfile.TemporaryDirectory() as name:
        make_scene(recipe, 0, Path(name))
        sequence = sequence_folder(Path(name), 0)
        true = np.tile(np.eye(4), (settings.drive, 1, 1))
        true[:, :3] = np.loadtxt(sequence / "poses.txt").reshape(-1, 3, 4)
        return float(absolute_trajectory_error(true, kiss_icp_poses(sequence / "velodyne"))[1])


def kiss_icp_poses(folder: Path) -> NDArray[np.float64]:
    """(N, 4, 4) poses of the scans in a folder by KISS-ICP, with its generic loader and its default settings."""
    config = KISSConfig(
        data=DataConfig(max_range=KISS_ICP_RANGE, min_range=0.0, deskew=False),
        mapping=MappingConfig(voxel_size=KISS_ICP_RANGE / 100),
        registration=RegistrationConfig(max_num_threads=1),
    )
    scans, odometry = GenericDataset(folder), KissICP(config)
    poses = np.empty((len(scans), 4, 4))
    for index in range(len(scans)):
        odometry.register_frame(*scans[index])
        poses[index] = odometry.last_pose
    return poses
