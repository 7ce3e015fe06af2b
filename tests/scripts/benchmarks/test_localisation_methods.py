"""The methods of the localisation benchmark on frames of a room, and along a drive."""

import numpy as np
import pytest

from pipeline.frame import Frame, Intrinsics
from pipeline.transforms import from_rotation, from_yaw, inverse
from sarsim.settings import EpisodeConfig
from scripts.benchmarks import localisation
from scripts.benchmarks.localisation_methods import METHODS
from scripts.benchmarks.runs import Job

K = Intrinsics(640, 480, 536, 536, 320, 240)
T_BASE_CAMERA = from_rotation(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0, 0, 0.6])


def ray_cast(T_world_base):
    """(H, W) depth and (H, W, 3) colours in a room of 4 m × 3 m × 2 m with its corner at (−1, −1.5, 0)."""
    T = T_world_base @ T_BASE_CAMERA
    rays, origin = K.rays.astype(float) @ T[:3, :3].T, T[:3, 3]
    low, high = np.array([-1, -1.5, 0]), np.array([3, 1.5, 2])
    with np.errstate(divide="ignore"):
        depth = (np.where(rays > 0, high - origin, low - origin) / rays).min(axis=-1)
    hits = origin + depth[..., None] * rays
    return depth.astype(np.float32), (127 + 100 * np.sin(7 * hits)).astype(np.uint8)


@pytest.mark.parametrize("name", [name for name in METHODS if name != "odometry"])
def test_a_method_is_better_than_an_odometry_that_is_too_long(name):
    """A room of three pairs of planes determines the pose for any registration."""
    method, true, odometry = METHODS[name](np.eye(4)), np.eye(4), np.eye(4)
    online, poses = [], []
    for n in range(12):
        poses.append(true)
        online.append(method.localise(Frame(0.5 * n, *ray_cast(true)[::-1], K, T_BASE_CAMERA, odometry)))
        true, odometry = true @ from_yaw(0.1, 0, 0, 0.03), odometry @ from_yaw(0.105, 0, 0, 0.03)
    off = method.corrected(np.array(online))[:, :3, 3] - np.array(poses)[:, :3, 3]
    assert np.linalg.norm(off[-1]) < 0.03 < 0.05  # of the odometry


@pytest.mark.parametrize("name", ["kiss_icp", "open3d"])
def test_a_blind_peer_follows_the_odometry(name):
    method = METHODS[name](from_yaw(1, 2, 0, 0))
    depth, rgb = ray_cast(np.eye(4))
    seen = [depth, np.zeros_like(depth), np.zeros_like(depth)]
    frames = [Frame(n, rgb, seen[n], K, T_BASE_CAMERA, from_yaw(0.1 * n, 0, 0, 0.2 * n)) for n in range(3)]
    poses = [method.localise(frame) for frame in frames]
    assert poses[0] == pytest.approx(from_yaw(1, 2, 0, 0))
    assert poses[2] == pytest.approx(poses[0] @ inverse(frames[0].T_odom_base) @ frames[2].T_odom_base)


@pytest.mark.parametrize("name", ["kiss_icp", "open3d"])
def test_a_peer_that_strays_counts_as_lost_and_follows_the_odometry(name):
    method = METHODS[name](np.eye(4))
    for n, T_world_base in enumerate((np.eye(4), from_yaw(0.3, 0, 0, 0))):
        depth, rgb = ray_cast(T_world_base)  # 0.3 m ahead, of which the odometry knows nothing
        pose = method.localise(Frame(n, rgb, depth, K, T_BASE_CAMERA, np.eye(4)))
    assert np.linalg.norm(pose[:3, 3]) < 0.1


def test_every_method_follows_a_drive_and_leaves_its_way(tmp_path, monkeypatch):
    monkeypatch.setattr(localisation, "MAX_FRAMES", 5)
    job = Job("nist_6x4", EpisodeConfig(labels="truth", detector=None))
    report = localisation.run_job(tuple(METHODS), tmp_path, job)["report"]
    assert 5 <= report["frames"] < 60  # the drive to the viewpoint under way is finished
    assert all(report[name]["frame_ms"] >= 0 for name in METHODS)
    ways = [np.loadtxt(tmp_path / f"{job.name}-{name}.tum") for name in (*METHODS, "true")]
    assert {way.shape for way in ways} == {(report["frames"], 8)}
    assert (np.diff(ways[0][:, 0]) > 0).all()  # each frame once
    assert all(way[0] == pytest.approx(ways[-1][0], abs=1e-2) for way in ways)  # they begin where the robot was
    moved = np.linalg.norm(np.diff(ways[-1][:, 1:3], axis=0), axis=1)
    assert moved.max() < 2 * localisation.FRAME_DISTANCE
