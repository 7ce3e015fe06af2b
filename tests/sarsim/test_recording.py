"""A short simulated episode, read back from its recording."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from scipy.spatial.transform import Rotation

from pipeline.explorer import Explorer
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.sink import Sink
from pipeline.transforms import inverse
from sarsim.arenas.load import load_arena
from sarsim.recording import EpisodeRecorder
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from tests.recordings import read

rr.set_strict_mode(True)  # otherwise a call with wrong arguments is a warning alone

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
DRIVING_TIME = 3.0
SPEED = 0.2


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    """The recording of two steps and a straight drive between them, by wheel odometry."""
    path = tmp_path_factory.mktemp("nist_6x4-3") / "episode.rrd"
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(odometry="wheel"), seed=3)
    explorer = Explorer(robot, Mapper(robot.model, TruthClassifier(), seed=3, localisation=OdometryLocalisation()))
    recorder = EpisodeRecorder(robot, path)
    explorer.watch(recorder)
    explorer.step()
    for _ in range(round(DRIVING_TIME / robot.control_period)):
        recorder.on_motion(robot.drive(Velocity(SPEED)))
    explorer.step()
    recorder.close()
    robot.close()
    return path


@pytest.fixture(scope="module")
def rows(path):
    return read(path)


def test_the_file_passes_reruns_own_check(path):
    subprocess.run([sys.executable, "-m", "rerun_cli", "rrd", "verify", str(path)], check=True)


def test_the_arena_is_there_by_label(rows):
    parts = {entity.rpartition("/")[2]: found[0] for entity, found in rows.items() if "/arena/" in entity}
    assert parts.keys() == {"wall", "terrain", "inclined_ramp", "straight_ramp", "victim"}
    floor, walls = (np.array(parts[name]["Mesh3D:vertex_positions"]) for name in ("terrain", "wall"))
    np.testing.assert_allclose([floor.min(axis=0), floor.max(axis=0)], [[-3, -2, 0], [3, 2, 0]], atol=1e-6)
    assert walls[:, 2].max() == pytest.approx(1.2)
    ramps = np.array(parts["inclined_ramp"]["Mesh3D:vertex_positions"])
    assert ramps[:, 2].max() == pytest.approx(0.17)


def test_the_arena_and_the_robots_shape_do_not_change(rows):
    shapes = [row for found in rows.values() for row in found if "Mesh3D:vertex_positions" in row]
    assert len(shapes) >= 5 + 6
    assert all("sim_time" not in row for row in shapes)


def test_wheels_stand_at_their_corners_and_roll_as_far_as_the_robot_drives(rows):
    for name in WHEELS:
        found = [row for row in rows[f"/world/robot/{name}_wheel"] if row.get("Transform3D:mat3x3")]
        centre = np.array([row["Transform3D:translation"][0] for row in found])
        side = 0.199 if "left" in name else -0.199
        end = 0.135 if "front" in name else -0.135
        np.testing.assert_allclose(centre, np.tile([end, side, 0.111], (len(centre), 1)), atol=2e-3)
        turns = Rotation.from_matrix([np.reshape(row["Transform3D:mat3x3"], (3, 3)).T for row in found])
        rolled = (turns[1:] * turns[:-1].inv()).as_rotvec()[:, 1].sum()
        assert rolled * 0.111 == pytest.approx(SPEED * (DRIVING_TIME - 0.5), abs=0.12)


def test_motion_is_thinned_to_five_poses_a_second(rows):
    times = np.array([row["sim_time"] for row in rows["/world/robot"] if row.get("step") is None])
    np.testing.assert_allclose(np.diff(times), 0.2, atol=1e-6)
    assert len(times) == DRIVING_TIME * 5


def test_true_and_believed_way_differ_by_the_error(rows):
    believed, true = (
        np.array(rows[f"/world/trajectory/{name}"][-1]["LineStrips3D:strips"][0]) for name in ("estimated", "true")
    )
    error = np.linalg.norm(believed[-1] - true[-1])
    assert 1e-5 < error < 0.1
    logged = [row["Scalars:scalars"][0] for row in rows["/metrics/position_error_m"]]
    assert len(logged) >= DRIVING_TIME * 5
    assert logged[-1] == pytest.approx(error, abs=1e-6)


def test_while_it_drives_the_robot_is_where_its_newest_keyframe_has_it(tmp_path):
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(odometry="wheel"), seed=3)
    slam = Slam()
    explorer = Explorer(robot, Mapper(robot.model, TruthClassifier(), seed=3, localisation=slam))
    recorder = EpisodeRecorder(robot, tmp_path / "episode.rrd")
    believed, true = {}, {}

    class Watch(Sink):
        def on_keyframe(self, keyframe):
            self.T_odom_keyframe = keyframe.frame.T_odom_base

        def on_motion(self, motion):
            T_map_base = slam.poses[-1] @ inverse(self.T_odom_keyframe) @ motion.T_odom_base
            believed[round(motion.time, 3)] = T_map_base[:3, 3]
            true[round(motion.time, 3)] = robot.trajectory[-1].T_world_base[:3, 3]

    explorer.watch(recorder, Watch())
    explorer.drive(explorer.step())
    recorder.close()
    robot.close()
    rows = read(tmp_path / "episode.rrd")
    moving = [row for row in rows["/world/robot"] if row.get("step") is None]
    assert len(moving) > 5
    assert len(slam.poses) > 2
    for row in moving:
        np.testing.assert_allclose(row["Transform3D:translation"][0], believed[round(row["sim_time"], 3)], atol=1e-6)
    for row in rows["/metrics/position_error_m"]:
        if row.get("step") is None:
            time = round(row["sim_time"], 3)
            error = np.linalg.norm(believed[time] - true[time])
            assert row["Scalars:scalars"][0] == pytest.approx(error, abs=1e-9)
    between = [row for row in rows["/world/localisation/keyframes"] if row.get("step") is None]
    assert between
