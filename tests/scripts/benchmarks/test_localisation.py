"""The localisation's benchmark: the figures of replayed drives, and each method's poses of frames."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.grid_map import Grid
from pipeline.transforms import from_rotation, from_yaw, inverse
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.settings import EpisodeConfig
from scripts.benchmarks import localisation
from scripts.benchmarks.localisation_drives import DriveJob, DriveWriter, drive_file
from scripts.benchmarks.localisation_methods import METHODS
from scripts.benchmarks.localisation_replay import replay_job
from scripts.benchmarks.settings import LocalisationSettings

K = Intrinsics(640, 480, 536, 536, 320, 240)
T_BASE_CAMERA = from_rotation(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0, 0, 0.6])
JOB = DriveJob("random", "ours", EpisodeConfig(arena="random:0", labels="truth"), 99)


def ray_cast(T_world_base):
    """(H, W) depth and (H, W, 3) colours in a room of 4 m × 3 m × 2 m with its corner at (−1, −1.5, 0)."""
    T = T_world_base @ T_BASE_CAMERA
    rays, origin = K.rays.astype(float) @ T[:3, :3].T, T[:3, 3]
    low, high = np.array([-1, -1.5, 0]), np.array([3, 1.5, 2])
    with np.errstate(divide="ignore"):
        depth = (np.where(rays > 0, high - origin, low - origin) / rays).min(axis=-1)
    hits = origin + depth[..., None] * rays
    return depth.astype(np.float32), (127 + 100 * np.sin(7 * hits)).astype(np.uint8)


def drive_to(path, settings, n=12, odometry_scale=1.05):
    """Write a drive along an arc, whose odometry is too long."""
    cells = np.ones((80, 60), bool)
    surface = GroundTruthSurface(Grid(np.array([-20, -30]), 0.05, cells.shape), np.zeros(cells.shape), cells, ~cells)
    true, odometry = [from_yaw(0, 0, 0, 0)], [from_yaw(0, 0, 0, 0)]
    for _ in range(n - 1):
        true.append(true[-1] @ from_yaw(0.1, 0, 0, 0.03))
        odometry.append(odometry[-1] @ from_yaw(0.1 * odometry_scale, 0, 0, 0.03))
    with DriveWriter(path, settings, surface) as writer:
        for number, (T_world_base, T_odom_base) in enumerate(zip(true, odometry, strict=True)):
            depth, rgb = ray_cast(T_world_base)
            writer.write(Frame(0.5 * number, rgb, depth, K, T_BASE_CAMERA, T_odom_base), T_world_base)


def test_every_method_follows_a_drive_and_leaves_its_way(tmp_path):
    drives, folder = tmp_path, tmp_path / "replays"
    folder.mkdir()
    drive_to(drive_file(JOB, drives), JOB.settings)
    replay_job(JOB, folder, drives, tuple(METHODS))
    report = JOB.result(folder)["report"]
    assert report["frames"] == 12
    assert report["way_m"] == pytest.approx(1.1)
    assert report["odometry"]["ate_m"] > 0.02
    # A room of three pairs of planes determines the pose for any registration.
    assert all(report[name]["ate_m"] < report["odometry"]["ate_m"] for name in METHODS if name != "odometry")
    assert all(report[name]["frame_ms"] >= 0 for name in METHODS)
    ways = [np.loadtxt(folder / f"{JOB.name}-{name}.tum") for name in (*METHODS, "true")]
    assert {way.shape for way in ways} == {(12, 8)}
    assert all(way[0] == pytest.approx(ways[-1][0], abs=1e-3) for way in ways)  # they begin where the robot was
    assert (folder / f"{JOB.name}.png").stat().st_size > 1000
    figures = localisation.figures_of({JOB: {"report": report}})
    assert figures["random.ours.ate_m.worst"] == report["ours"]["ate_m"]
    assert figures["ours.keyframe_ms"] > 0


@pytest.mark.parametrize("name", ["kiss_icp", "open3d"])
def test_a_blind_peer_follows_the_odometry(name):
    method = METHODS[name](from_yaw(1, 2, 0, 0))
    depth, rgb = ray_cast(np.eye(4))
    seen = [depth, np.zeros_like(depth), np.zeros_like(depth)]
    frames = [Frame(n, rgb, seen[n], K, T_BASE_CAMERA, from_yaw(0.1 * n, 0, 0, 0.2 * n)) for n in range(3)]
    poses = [method.localise(frame) for frame in frames]
    assert poses[0] == pytest.approx(from_yaw(1, 2, 0, 0))
    moved = inverse(frames[0].T_odom_base) @ frames[2].T_odom_base
    assert poses[2] == pytest.approx(poses[0] @ moved)


@pytest.mark.parametrize("name", ["kiss_icp", "open3d"])
def test_a_peer_that_strays_counts_as_lost_and_follows_the_odometry(name):
    method = METHODS[name](np.eye(4))
    for n, T_world_base in enumerate((np.eye(4), from_yaw(0.3, 0, 0, 0))):
        depth, rgb = ray_cast(T_world_base)  # 0.3 m ahead, of which the odometry knows nothing
        pose = method.localise(Frame(n, rgb, depth, K, T_BASE_CAMERA, np.eye(4)))
    assert np.linalg.norm(pose[:3, 3]) < 0.1


def report(ours, kiss, frame_ms=30.0, loops=2):
    figures = {"keyframe_ms": 10.0, "correction_ms": 5.0, "loops": loops, "false_loops": 1, "nees": 1.5}
    return {"report": {"ours": {"ate_m": ours} | figures, "kiss_icp": {"ate_m": kiss, "frame_ms": frame_ms}}}


def jobs(group, n):
    return [DriveJob(group, "ours", EpisodeConfig(arena=group, seed=seed), 9) for seed in range(n)]


def test_figures_are_of_groups_and_ratios_of_medians():
    first, second, third = jobs("nist_6x4", 3)
    (other,) = jobs("raf", 1)
    replayed = {first: report(0.1, 0.2), second: report(0.2, 0.4), third: report(0.3, 1.5, 60.0), other: None}
    figures = localisation.figures_of(replayed)
    assert figures["nist_6x4.runs"] == 3
    assert figures["nist_6x4.ours.ate_m.median"] == figures["nist_6x4.kiss_icp.ate_m.median"] / 2 == 0.2
    assert figures["nist_6x4.ours.ate_m.worst"] == 0.3
    assert figures["nist_6x4.kiss_icp_vs_ours"] == pytest.approx(2)
    assert figures["kiss_icp_vs_ours_time"] == 3
    assert figures["ours.keyframe_ms"] == 10
    assert figures["ours.correction_ms"] == 5
    assert figures["loops"] == 6
    assert figures["false_loops"] == 3
    assert figures["nees"] == 1.5
    assert not [name for name in figures if name.startswith(("raf", "open3d"))]


def test_each_arena_is_driven_with_each_seed_once(tmp_path, monkeypatch):
    driven = []
    monkeypatch.setattr(localisation, "run_jobs", lambda jobs, *_: driven.extend(jobs) or [None] * len(jobs))
    settings = LocalisationSettings(nist=2, esogu=0, random=1, seeds=(6, 7), runs=tmp_path)
    localisation.measure(settings)
    assert sorted(job.name for job in driven) == [
        "ours-nist_6x4-6", "ours-nist_6x4-7", "ours-random_0-6", "ours-random_0-7"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"nist": -1}, "--nist -1:"),
        ({"frames": 0}, "--frames 0:"),
        ({"raf": Path("/nowhere")}, "--raf /nowhere"),
        ({"nist": 0, "esogu": 0, "random": 0}, "no arena"),
    ],
)
def test_what_cannot_be_measured_is_refused(flags, message):
    with pytest.raises(InputError, match=message):
        localisation.measure(LocalisationSettings(**flags))


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setattr(localisation, "find_spec", lambda name: None if name == "evo" else name)
    with pytest.raises(InputError, match=r"evo .*pip install"):
        localisation.measure(LocalisationSettings())
