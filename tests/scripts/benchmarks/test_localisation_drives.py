"""Drives are recorded with wheel odometry and true poses, and read as they were written."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.grid_map import Grid
from pipeline.transforms import from_yaw, inverse
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.localisation_drives import SPACING, TURN, DriveJob, DriveReader, DriveWriter, record_job
from tests.sarsim.rooms import room

SURFACE = GroundTruthSurface(
    Grid(np.array([-3, 2]), 0.05, (4, 3)), np.zeros((4, 3)), np.ones((4, 3), bool), np.eye(4, 3) > 0
)
JOB = DriveJob("nist_6x4", "ours", EpisodeConfig(labels="truth", detector=None), 5)


def frame_of(n):
    rng = np.random.default_rng(n)
    return Frame(
        time=0.5 * n,
        rgb=np.full((48, 64, 3), (10 * n, 100, 200), np.uint8),
        depth=np.where(rng.random((48, 64)) < 0.2, 0, rng.uniform(0.8, 3.5, (48, 64))).astype(np.float32),
        intrinsics=Intrinsics(64, 48, 60, 61, 32, 24),
        T_base_camera=from_yaw(0, 0, 0.6, 0),
        T_odom_base=from_yaw(0.1 * n, 0, 0, 0.1),
    )


def test_a_drive_is_read_as_it_was_written(tmp_path):
    true = [from_yaw(0.1 * n, 0.01, 0, 0) for n in range(3)]
    with DriveWriter(tmp_path / "drive.h5", {"group": "g"}, SURFACE) as writer:
        for n in range(3):
            writer.write(frame_of(n), true[n])
    with DriveReader(tmp_path / "drive.h5") as drive:
        assert len(drive) == 3
        assert drive.settings == {"group": "g"}
        assert (drive.T_world_base == true).all()
        assert (drive.surface.walls == SURFACE.walls).all()
        assert (drive.surface.grid.origin == SURFACE.grid.origin).all()
        for n, frame in enumerate(drive):
            written = frame_of(n)
            assert frame.intrinsics == written.intrinsics
            assert frame.time == written.time
            assert frame.depth.dtype == np.float32
            assert np.abs(frame.depth - written.depth).max() <= 0.00051
            assert ((frame.depth > 0) == (written.depth > 0)).all()
            assert np.abs(frame.rgb.astype(int) - written.rgb).max() <= 3
            assert (frame.T_odom_base == written.T_odom_base).all()
            assert (frame.T_base_camera == written.T_base_camera).all()


def test_what_is_no_drive_is_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        DriveReader(tmp_path / "drive.h5")
    with DriveWriter(tmp_path / "empty.h5", {}, SURFACE):
        pass
    with pytest.raises(InputError, match=r"empty\.h5"):
        DriveReader(tmp_path / "empty.h5")


def test_a_recorded_drive_has_the_wheels_poses_beside_the_true_ones(tmp_path):
    record_job(JOB, tmp_path)
    result = JOB.result(tmp_path)
    with DriveReader(tmp_path / f"{JOB.name}.h5") as drive:
        assert result["frames"] == len(drive)
        assert JOB.frames <= len(drive) < 60  # the drive to the viewpoint under way is finished
        assert (np.diff(drive.time) > 0).all()
        off = np.linalg.norm(drive.T_world_base[:, :3, 3] - drive.T_odom_base[:, :3, 3], axis=1)
        assert off[0] < 0.01
        assert 0 < off[-1] < 0.2
        moved = [inverse(a) @ b for a, b in zip(drive.T_world_base[:-1], drive.T_world_base[1:], strict=True)]
        assert all(np.linalg.norm(T[:2, 3]) < 2 * SPACING and np.arctan2(T[1, 0], T[0, 0]) < 2 * TURN for T in moved)
        assert drive.surface.drivable.any()
        assert drive.frame(0).depth.any()


def test_a_drive_that_ends_because_all_is_seen_has_each_frame_with_its_own_pose(tmp_path):
    """The robot still rolls when it decides so."""
    (tmp_path / "room.xml").write_text(room((-0.8, 4), (-0.8, 0.8)))
    config = EpisodeConfig(arena=str(tmp_path / "room.xml"), labels="truth", detector=None)
    job = DriveJob("room", "ours", config, 1000)
    record_job(job, tmp_path)
    with DriveReader(tmp_path / f"{job.name}.h5") as drive:
        assert (np.diff(drive.time) > 0).all()
        assert len(drive) == job.result(tmp_path)["frames"] < 1000


def test_a_drive_depends_on_its_length_but_on_no_network():
    longer = DriveJob(JOB.group, JOB.strategy, JOB.config, 6)
    assert longer.settings != JOB.settings
    assert not {"weights", "detector"} & set(JOB.settings["config"])


def test_an_arena_without_a_start_is_left_out(tmp_path):
    job = DriveJob("raf", "ours", EpisodeConfig(arena=str(tmp_path / "none.raf"), labels="truth"), 5)
    record_job(job, tmp_path)
    assert "none.raf" in job.result(tmp_path)["left_out"]
