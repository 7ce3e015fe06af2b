"""The lidar in episodes, datasets and on networks, and commands that have none."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr
import yaml
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.errors import InputError
from pipeline.labels import COLOURS
from pipeline.plugin import RunContext
from pipeline.robot import Velocity
from pipeline.sink import Result
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import run_guarded
from sarsim.commands.generate_dataset import GenerateDatasetConfig, generate_dataset
from sarsim.dataset.generate import generate
from sarsim.dataset.scene_file import Scene
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.lidar.plugin import Lidar, log_scan
from sarsim.plugins.lidar.ros import scan_messages
from sarsim.settings import EpisodeConfig, MapRecordingConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from tests.recordings import read
from tests.refusal import refusal
from tests.sarsim.dataset.small import RECIPE, InProcess, files
from tests.sarsim.plugins.lidar.hall import CROSS, Hall

SMALL = LidarConfig("4x60")


def driven(plugin: Lidar, out: Path, periods: int = 20) -> SimulatedRobot:
    """A robot that has driven ahead with the lidar for some control periods, as an episode drives it."""
    world = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), 0)
    robot = plugin.wrap(world, world, None)
    (sink,) = plugin.sinks(RunContext(None, None, None, world, [plugin], out))
    for _ in range(periods):
        robot.drive(Velocity(0.2))
    result = Result(out, None, None, 1, 0.0, 0.0)
    sink.finish(result)
    assert result.figures["lidar"]["scans"] == len(list((out / "lidar/sequences/00/velodyne").iterdir()))
    world.close()
    return world


@pytest.mark.parametrize("rolling", [False, True])
def test_a_drive_leaves_a_sequence_with_its_true_poses(tmp_path, rolling):
    plugin = Lidar(replace(SMALL, rolling=rolling), EpisodeConfig(out=tmp_path))
    world = driven(plugin, tmp_path)
    folder = tmp_path / "lidar/sequences/00"
    times, poses = np.loadtxt(folder / "times.txt"), np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    assert len(times) == (7 if rolling else 8)
    assert poses[-1, 0, 3] > poses[0, 0, 3]
    at = [
        np.interp(times, [p.time for p in world.trajectory], [p.T_world_base[k, 3] for p in world.trajectory])
        for k in (0, 1)
    ]
    ahead = 0.17  # of the axle to the mast
    assert_allclose(poses[:, :2, 3], np.stack(at, axis=1) + ahead * poses[:, :2, 0], atol=2e-3)
    assert yaml.safe_load((tmp_path / "lidar/labels.yaml").read_text())["split"]["train"] == [0]


def test_the_seed_decides_the_scans(tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        (tmp_path / name).mkdir()
        driven(Lidar(SMALL, EpisodeConfig(out=tmp_path / name, seed=seed)), tmp_path / name, 4)
    first, again, other = (files(tmp_path / name / "lidar") for name in "abc")
    assert first == again
    assert first != other


def test_a_dataset_has_a_scan_of_every_frame_and_scenes_that_are_the_same_without(tmp_path):
    recipe = replace(RECIPE, plugins={"lidar": SMALL})
    generate(recipe, 2, tmp_path / "with", InProcess())
    generate(RECIPE, 2, tmp_path / "without", InProcess())
    for scene in ("00000", "00001"):
        path = f"scenes/{scene}.h5"
        assert (tmp_path / "with" / path).read_bytes() == (tmp_path / "without" / path).read_bytes()
    assert not (tmp_path / "without" / "lidar").exists()
    folder = tmp_path / "with/lidar/sequences"
    assert sorted(path.name for path in folder.iterdir()) == ["00", "01"]
    with Scene(tmp_path / "with/scenes/00001.h5") as scene:
        assert_allclose(np.loadtxt(folder / "01/times.txt"), scene.time, atol=1e-6)
        poses = np.loadtxt(folder / "01/poses.txt").reshape(-1, 3, 4)
        camera = np.array([scene.T_world_camera(k)[:3, 3] for k in range(len(scene))])
        assert_allclose(poses[:, :, 3], camera + 0.06 * scene.pose_true[:, :3, 2], atol=1e-6)
        ids = np.fromfile(folder / "01/labels/000000.label", np.uint32)
        assert_array_equal(scene.content.geom_label[(ids >> 16) - 1], ids & 0xFFFF)
    assert yaml.safe_load((tmp_path / "with/lidar/labels.yaml").read_text())["split"]["train"] == [0, 1]


def test_a_dataset_is_only_continued_with_the_same_lidar(tmp_path):
    recipe = replace(RECIPE, plugins={"lidar": SMALL})
    generate(recipe, 1, tmp_path, InProcess())
    before = files(tmp_path / "lidar")
    engine = InProcess()
    generate(recipe, 1, tmp_path, engine)
    assert not engine.made
    assert files(tmp_path / "lidar") == before
    for other in (RECIPE, replace(RECIPE, plugins={"lidar": LidarConfig("4x61")})):
        with pytest.raises(InputError, match=r"contains a dataset with plugins = .*; choose another folder"):
            generate(other, 1, tmp_path, InProcess())


def test_a_scene_that_fails_leaves_no_sequence(tmp_path):
    plugin, hall = Lidar(SMALL, RECIPE), Hall()
    world = SimpleNamespace(model=hall.world, data=hall.data, camera=SimpleNamespace(base_body=hall.base))
    with pytest.raises(InputError, match="nothing goes"), plugin.scene(world, tmp_path, 5) as watcher:
        watcher(SimpleNamespace(time=0.0))
        raise InputError("nothing goes")
    assert not list(tmp_path.glob("lidar/sequences/*"))


def test_commands_without_a_simulated_robot_refuse_it():
    with pytest.raises(InputError, match="--lidar: only a simulated robot has this lidar"):
        make_plugins(MapRecordingConfig(path=Path("bag"), out=Path("out"), plugins={"lidar": SMALL}))


def test_datasets_refuse_plugins_that_add_nothing_to_them(tmp_path, capsys):
    config = GenerateDatasetConfig(out=tmp_path / "out", plugins={"finds": None})
    assert "--finds: this command has no use for it" in refusal(capsys, run_guarded, lambda: generate_dataset(config))
    assert not (tmp_path / "out").exists()


def test_a_run_without_it_imports_nothing_of_it():
    code = "import sys, sarsim.episode, sarsim.dataset.generate; from sarsim.methods.plugins import make_plugins\n"
    code += "from sarsim.settings import EpisodeConfig; make_plugins(EpisodeConfig())\n"
    code += "assert not [name for name in sys.modules if name.startswith('sarsim.plugins')], sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_measurements_are_asked_for_once(tmp_path):
    plugin = Lidar(SMALL, EpisodeConfig(out=tmp_path))
    driven(plugin, tmp_path, 4)
    topics = [topic for topic, _, _ in plugin.measurements()]
    assert topics == ["/tf", "/points"] * 2
    assert not list(plugin.measurements())


def test_a_cloud_says_of_every_point_what_was_scanned():
    scan = Hall().scanner(LidarConfig("4x60").model(), seed=0).scan(2.5)
    messages = {topic: message for topic, _, message in scan_messages(scan, LidarConfig("4x60").model(), np.eye(4))}
    assert [*messages] == ["/tf", "/points"]
    cloud = messages["/points"]
    assert (cloud.header.frame_id, cloud.header.stamp.sec, cloud.header.stamp.nanosec) == ("lidar", 2, 500_000_000)
    kinds = {7: "f4", 5: "i4", 4: "u2", 2: "u1"}
    layout = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [kinds[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    points = np.frombuffer(cloud.data.tobytes(), layout)
    assert_array_equal(np.stack([points[axis] for axis in "xyz"], axis=1), scan.points)
    for name in ("ring", "time", "label", "instance", "intensity"):
        assert_array_equal(points[name], getattr(scan, name))


def test_a_lidar_with_one_row_also_sends_ranges():
    hall, model = Hall(), replace(CROSS, elevations=(0.0,))
    messages = {topic: message for topic, _, message in scan_messages(hall.scanner().scan(0.0), model, np.eye(4))}
    scan = messages["/scan"]
    assert_allclose(scan.ranges, [3, np.inf, 4, 3], atol=1e-6)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    assert_allclose(angles, [-np.pi, -np.pi / 2, 0, np.pi / 2], atol=1e-6)
    assert scan.angle_max == pytest.approx(np.pi / 2)
    assert (scan.range_min, scan.range_max, scan.time_increment) == (0.1, 30, 0)


def test_a_scan_is_drawn_in_the_colours_of_its_labels(tmp_path):
    path = tmp_path / "scan.rrd"
    stream = rr.RecordingStream("sarsim")
    stream.save(path)
    scan = Hall().scanner().scan(0.0)
    log_scan(stream, scan, np.eye(4))
    stream.flush()
    stream.disconnect()
    (row,) = read(path)["/world/robot/lidar"]
    colours = [(value >> 24, value >> 16 & 255, value >> 8 & 255) for value in row["Points3D:colors"]]
    assert_array_equal(colours, COLOURS[scan.label])
    assert_allclose(row["Points3D:positions"], scan.points)
