"""map_recording.py: the files that it writes for whole and broken recordings."""

import json
import re
import shutil
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.convert import convert

from pipeline.datasets.messages import pose_matrix
from pipeline.datasets.recording import CameraPose
from pipeline.localisation.trajectory import read_trajectory, write_tum
from pipeline.metric_map.io.npz import load_metric_map
from pipeline.plugins.league.brief import HANDED_IN
from pipeline.plugins.league.validation import validate
from pipeline.plugins.ros.messages import header, make, transforms
from pipeline.plugins.ros.topics import ImageFormat
from pipeline.semantic_map.ply import read_ply
from pipeline.sensor import XTION
from pipeline.transforms import from_rotation, from_yaw, inverse
from sarsim.commands.map_recording import MapRecordingConfig, map_recording, open_recording, set_sensor
from sarsim.commands.recorded_drive import camera_pose
from sarsim.commands.settings import run_with_settings
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.generate import generate
from sarsim.dataset.recipe import Recipe
from sarsim.plugins.ros.mcap import Mcap
from sarsim.robots.names import robot_file
from scripts.benchmarks.localisation_scores import evo_ate
from tests.pipeline.datasets.recorded_room import (
    ODOMETRY,
    TO_ROS_1,
    WAY,
    camera_poses,
    frames,
    write_bag,
    write_images,
    write_tum_folder,
)
from tests.pipeline.localisation.driving_robot import T_BASE_CAMERA
from tests.pipeline.polygon_scene import HALF, floor, look, wall
from tests.pipeline.rescue_report.html_page import Tag, read
from tests.sarsim.dataset.small import InProcess

FILES = {
    "config.yaml", "episode.rrd", "finds.json", "keyframes.npz", "metric_map.npz", "report.html", "report.json",
    "semantic_map.ply", "topology.json", "trajectory_estimated.tum", "trajectory_true.tum", "victims.csv",
    "victims.json",
}  # fmt: skip


def run(*words: object) -> None:
    run_with_settings(map_recording, MapRecordingConfig, [*map(str, words), "--detector", "None"])


def failed(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The line that a command ends with, whose status is 2."""
    with pytest.raises(SystemExit) as raised:
        run(*words)
    assert raised.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    run(write_bag(folder / "room"), "--out", folder / "out", "--labels", "truth", "--mission", "league")
    return folder / "out"


def test_it_leaves_the_files_of_an_episode(mapped: Path) -> None:
    assert {path.name for path in mapped.iterdir()} == FILES | {HANDED_IN}
    assert validate(mapped) == []
    report = json.loads((mapped / "report.json").read_text())
    assert report["recording"]["frames"] == len(frames())
    assert report["recording"]["left_out"] == {}
    assert report["localisation"]["keyframes"] == report["recording"]["keyframes"] > report["steps"] > 0
    assert len(load_metric_map(mapped / "metric_map.npz").occupied_centres()) > 500
    page = read((mapped / "report.html").read_text())
    assert "room" in page.text
    assert not [tile.text for tile in page.all("div", "tile") if "good" in tile.attributes["class"]]


def test_the_error_is_evos(mapped: Path) -> None:
    report = json.loads((mapped / "report.json").read_text())
    ate = evo_ate(mapped / "trajectory_true.tum", mapped / "trajectory_estimated.tum")
    assert report["localisation"]["ate_rmse_m"] == pytest.approx(ate, abs=2e-6)
    assert 0 < ate < 0.015


def test_what_came_before_a_broken_image_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def broken(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if topic == "/camera/depth/image_raw" and time > 0.75:
            message.data = message.data[:1000]
        yield topic, time, message

    path, out = write_bag(tmp_path / "room", change=broken), tmp_path / "out"
    line = failed(capsys, path, "--out", out, "--labels", "truth", "--poses", "registration")
    assert line.startswith("error: ") and "truncated image" in line
    assert {path.name for path in out.iterdir()} == FILES
    report = json.loads((out / "report.json").read_text())
    assert report["recording"]["frames"] == 8
    assert "truncated image" in report["recording"]["stopped"]


def test_a_recording_of_nothing_leaves_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def blank(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        is_depth = topic == "/camera/depth/image_raw"
        return [(topic, time, replace(message, data=np.zeros_like(message.data)) if is_depth else message)]

    path, out = write_bag(tmp_path / "room", change=blank), tmp_path / "out"
    assert "frame" in failed(capsys, path, "--out", out, "--labels", "truth")
    assert not out.exists()


def test_gaps_cost_no_more_than_the_frames_in_them(tmp_path: Path) -> None:
    def gappy(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        blind = topic.startswith("/camera/depth/image") and 0.15 < time < 0.45
        lost = topic in ("/odom", "/tf") and 0.55 < time < 1.15
        return [] if blind or lost else [(topic, time, message)]

    run(write_bag(tmp_path / "room", change=gappy), "--out", tmp_path / "out", "--labels", "truth")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["recording"]["left_out"] == {"frames without a known pose": 6}
    assert report["recording"]["frames"] == len(frames()) - 3 - 6
    assert report["localisation"]["ate_rmse_m"] < 0.03


@pytest.mark.parametrize("every", [1, 4])
def test_the_drift_is_the_error_at_the_end_over_the_way(every: int, tmp_path: Path) -> None:
    # Straight on by 1.2 m, which the odometry takes for 2% more; in steps of 15 or of 60 cm.
    straight = 9
    poses = {"groundtruth": camera_poses(WAY[:straight]), "odometry": camera_poses(ODOMETRY[:straight])}
    folder = write_tum_folder(tmp_path / "room", straight, **poses)
    for name in ("depth.txt", "rgb.txt"):
        lines = (folder / name).read_text().splitlines()[1:]
        (folder / name).write_text("\n".join(lines[::every]))
    write_tum(folder / "camera.txt", [0.0], [T_BASE_CAMERA])
    run(folder, "--out", tmp_path / "out", "--poses", "odometry", "--labels", "rules")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["localisation"]["drift_percent"] == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("unknown", [range(5), range(5, 13)])
def test_a_gap_in_the_true_poses_costs_only_the_comparison_there(unknown: range, tmp_path: Path) -> None:
    folder = write_tum_folder(tmp_path / "room", groundtruth=camera_poses(WAY), odometry=camera_poses(WAY))
    lines = (folder / "groundtruth.txt").read_text().splitlines()[1:]
    known = [line for k, line in enumerate(lines) if k not in unknown]
    (folder / "groundtruth.txt").write_text("\n".join(known))
    write_tum(folder / "camera.txt", [0.0], [T_BASE_CAMERA])
    run(folder, "--out", tmp_path / "out", "--poses", "odometry", "--labels", "rules")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["localisation"]["keyframes"] == report["recording"]["keyframes"] > 4
    assert report["localisation"]["ate_rmse_m"] == pytest.approx(0, abs=1e-6)
    estimated = read_trajectory(tmp_path / "out" / "trajectory_estimated.tum", of_camera=False)
    np.testing.assert_allclose(estimated.poses, WAY, atol=1e-5)
    true = read_trajectory(tmp_path / "out" / "trajectory_true.tum", of_camera=False)
    np.testing.assert_allclose(true.poses, [T for k, T in enumerate(WAY) if k not in unknown], atol=1e-5)


@pytest.mark.parametrize("beside", ["camera.yaml", "metadata.yaml", "room.bag", "notes.db3"])
def test_a_folder_of_images_is_one_whatever_lies_beside_them(beside: str, tmp_path: Path) -> None:
    folder = write_tum_folder(tmp_path / "room", 2)
    (folder / beside).write_text("camera: 1\n")
    recording = open_recording(MapRecordingConfig(path=folder, out=tmp_path / "out"))
    assert len(list(recording.frames())) == 2
    assert any("bag" in note for note in recording.notes) == (not beside.endswith(".yaml"))


def test_a_bag_is_one_whatever_its_folder_is_called_and_holds(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "room", number=2)
    (bag / "camera.txt").write_text("0 0 0 0 0 0 0 1")
    (bag / "depth").mkdir()
    (tmp_path / "alone").mkdir()
    convert([bag], tmp_path / "alone" / "room.bag", **TO_ROS_1)
    (bag / "metadata.yaml").unlink()
    recording = open_recording(MapRecordingConfig(path=bag, out=tmp_path / "out"))
    assert len(list(recording.frames())) == 2
    assert len(list(open_recording(MapRecordingConfig(path=tmp_path / "alone", out=tmp_path / "out")).frames())) == 2


def test_a_scene_is_one_whatever_it_is_called(tmp_path: Path) -> None:
    generate(Recipe(seed=3, frames=2, width=80, height=60, arenas=("nist_6x4",)), 1, tmp_path / "data", InProcess())
    (scene,) = (tmp_path / "data" / "scenes").glob("*.h5")
    path = scene.rename(tmp_path / "scene.hdf5")
    assert len(list(open_recording(MapRecordingConfig(path=path, out=tmp_path / "out")).frames())) == 2


@pytest.fixture(scope="module")
def ways_in(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same frames as a scene's file, a TUM folder with and without the camera's place, and a ROS bag."""
    folder = tmp_path_factory.mktemp("ways")
    recipe = Recipe(seed=3, frames=6, width=160, height=120, arenas=("nist_6x4",))
    generate(recipe, 1, folder / "data", InProcess())
    (scene,) = (folder / "data" / "scenes").glob("*.h5")
    list(Tum(folder / "data", folder / "tum").run())
    list(Mcap(folder / "data", folder / "bags").run())
    shutil.copytree(folder / "tum" / "arena_0", folder / "without")
    (folder / "without" / "camera.txt").unlink()
    bag, tum = folder / "bags" / "arena_0", folder / "tum" / "arena_0"
    return {"scene": scene, "tum": tum, "bag": bag, "without": folder / "without"}


@pytest.mark.parametrize("poses", ["truth", "slam"])
def test_the_same_frames_make_one_map_and_one_verdict(poses: str, ways_in: dict[str, Path], tmp_path: Path) -> None:
    for name in ("scene", "tum", "bag"):
        run(ways_in[name], "--out", tmp_path / name, "--labels", "rules", "--poses", poses)
    verdicts = {tuple(tile.text for tile in tiles(tmp_path / name)) for name in ("scene", "tum", "bag")}
    assert len(verdicts) == 1
    scene, tum, bag = (load_metric_map(tmp_path / name / "metric_map.npz") for name in ("scene", "tum", "bag"))
    np.testing.assert_array_equal(scene.bounds(), tum.bounds())
    np.testing.assert_array_equal(scene.log_odds(*scene.bounds()), tum.log_odds(*tum.bounds()))
    # A bag's poses are quaternions, so a ray in a million may end in the voxel beside.
    assert len(bag.occupied_centres()) == pytest.approx(len(scene.occupied_centres()), rel=1e-3)
    errors = [json.loads((tmp_path / name / "report.json").read_text())["localisation"] for name in ("tum", "bag")]
    assert errors[0]["ate_rmse_m"] == pytest.approx(errors[1]["ate_rmse_m"], abs=1e-4)


def tiles(folder: Path) -> list[Tag]:
    """The verdicts on a run's page."""
    return read((folder / "report.html").read_text()).all("div", "tile")


def test_without_the_cameras_place_the_page_says_what_it_cannot_tell(
    ways_in: dict[str, Path], tmp_path: Path
) -> None:
    run(ways_in["without"], "--out", tmp_path, "--labels", "rules")
    assert not [tile.text for tile in tiles(tmp_path) if "good" in tile.attributes["class"] or " 0%" in tile.text]
    (summary,) = read((tmp_path / "report.html").read_text()).all("p", "summary")
    notes = json.loads((tmp_path / "report.json").read_text())["recording"]["notes"]
    assert "--camera-pose" in summary.text and all("--camera-pose" in note for note in notes)
    found = re.search(r"\(([\d.]+) m high, tilted down by (\d+)°\)", notes[-1])
    assert found is not None  # it is 0.60 m and 12°, although a ramp fills the first image
    assert float(found[1]) == pytest.approx(0.6, abs=0.06) and float(found[2]) == pytest.approx(12, abs=2)


@pytest.mark.parametrize(
    ("kind", "flags", "said"),
    [
        ("tum", {"topics": ("/x",)}, "--topics"),
        ("bag", {"fps": 20.0, "depth_scale": 1000.0}, "--depth-scale and --fps"),
        ("scene", {"intrinsics": (500.0, 500.0, 80.0, 60.0)}, "--intrinsics"),
    ],
)
def test_flags_without_an_effect_are_said(kind: str, flags: dict, said: str, ways_in: dict[str, Path]) -> None:
    notes = open_recording(MapRecordingConfig(path=ways_in[kind], out=Path("out"), **flags)).notes
    assert any(f"ignoring {said}, " in note for note in notes)


AHEAD = 5.4  # m; at least 4.6 m along the optical axis in the views below
HALL = [floor(-1, 6, -4, 4), wall((AHEAD, -4), (AHEAD, 4)), *(wall((AHEAD, side), (-1, side)) for side in (-4, 4))]
"""A hall with a wall ahead of the robot."""


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A TUM folder of a camera that sees 6 m, in which the robot turns left and right on the spot."""
    folder = tmp_path_factory.mktemp("hall") / "hall"
    turns = [from_yaw(0.0, 0.0, 0.0, yaw) for yaw in (0.0, 0.15, 0.0, -0.15)]
    views = [
        look(HALL, T @ T_BASE_CAMERA, sigma=0.005, seed=k, reach=(0.3, 6.0), camera=HALF) for k, T in enumerate(turns)
    ]
    write_images(
        folder, [replace(view, time=0.5 * k) for k, view in enumerate(views)], groundtruth=camera_poses(turns)
    )
    write_tum(folder / "camera.txt", [0.0], [T_BASE_CAMERA])
    return folder


def mapped_ahead(hall: Path, out: Path, *flags: object) -> tuple[int, int]:
    """Numbers of occupied voxels, and of labelled points, of the wall ahead."""
    run(hall, "--out", out, "--poses", "truth", "--labels", "rules", *flags)
    voxels = load_metric_map(out / "metric_map.npz").occupied_centres()
    cloud = read_ply(out / "semantic_map.ply")
    return tuple(int(np.count_nonzero(np.abs(x - AHEAD) < 0.2)) for x in (voxels[:, 0], cloud["x"]))


def test_a_wall_is_mapped_if_the_camera_sees_that_far(hall: Path, tmp_path: Path) -> None:
    voxels, points = mapped_ahead(hall, tmp_path / "far", "--depth-range", 0.3, 6)
    assert voxels > 300 and points > 300
    assert mapped_ahead(hall, tmp_path / "near", "--depth-range", 0.3, 4) == (0, 0)
    config = tmp_path / "config.yaml"
    config.write_text("pipeline: {metric_map: {max_range: 4.0}}")
    voxels, points = mapped_ahead(hall, tmp_path / "file", "--depth-range", 0.3, 6, "--config", config)
    assert voxels == 0 and points > 300


def test_a_named_camera_gives_the_range(hall: Path, tmp_path: Path) -> None:
    named = tmp_path / "kinect2_hall"
    shutil.copytree(hall, named)
    assert mapped_ahead(named, tmp_path / "out") == (0, 0)  # it sees 4.5 m
    notes = json.loads((tmp_path / "out" / "report.json").read_text())["recording"]["notes"]
    assert any("kinect2_hall" in note and "--depth-range" in note for note in notes)
    voxels, points = mapped_ahead(named, tmp_path / "far", "--depth-range", 0.3, 6)
    assert voxels > 300 and points > 300


@pytest.mark.parametrize(
    ("flags", "said"), [(("--depth-range", 6, 0.5), "--depth-range 6 0.5"), (("--depth-noise", 3), "--depth-noise 3")]
)
def test_a_range_or_noise_of_no_camera_is_refused(
    flags: tuple, said: str, hall: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in failed(capsys, hall, "--out", tmp_path / "out", *flags)
    assert not (tmp_path / "out").exists()


def test_sarsims_own_recordings_are_of_its_own_camera(ways_in: dict[str, Path]) -> None:
    for name in ("scene", "tum", "bag"):
        recording = open_recording(MapRecordingConfig(path=ways_in[name], out=Path("out")))
        assert recording.sensor == XTION
        assert not [note for note in recording.notes if "--depth-range" in note]


TILT = float(np.degrees(0.25))  # degrees, of the camera in the bags
RENAMED = {
    "/camera/color/image_raw": "/camera/rgb/image_color",
    "/camera/color/camera_info": "/camera/rgb/camera_info",
    "/camera/depth/image_raw": "/camera/depth/image",
    "/camera/depth/camera_info": "/camera/depth/camera_info",
    "/odom": "/pose",
    "/imu": "/imu",
}
"""Topics of the benchmark's bags, by those of sarsim."""


def pioneer(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """What the Pioneer of the TUM RGB-D benchmark recorded: it takes its camera for level, and 0.3 m high.

    The camera hangs by turns at the robot and at the marker that the motion capture system tracks.
    """
    if topic.startswith("/camera/") and topic in RENAMED:
        message.header.frame_id = "/openni_rgb_optical_frame"
    elif topic == "/imu":
        message.header.frame_id = ""
    elif topic == "/odom":
        message.header.frame_id, message.child_frame_id = "/odom", "/base_link"
        level = CameraPose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0).T_base_camera
        links = {
            ("/odom", "/base_link"): pose_matrix(message.pose.pose.position, message.pose.pose.orientation),
            ("/base_link", "/laser"): from_rotation(np.eye(3), [0.1, 0, 0.25]),
            ("/openni_camera", "/openni_rgb_optical_frame"): level,
            ("/world", "/kinect"): from_rotation(np.eye(3), [5.0 + time, 2.0, 0.6]),
        }
        turns = [("/laser", "/openni_camera"), ("/kinect", "/openni_camera")]
        T = from_rotation(np.eye(3), [0, 0, 0.05])
        for link in turns if round(time * 10) % 2 else turns[::-1]:
            yield "/tf", time, transforms(time, links | {link: T})
        yield (
            "/scan",
            time,
            make("sensor_msgs/LaserScan", header(time, "/laser"), *[1.0] * 7, *[np.ones(3, "f4")] * 2),
        )
    if topic in RENAMED:
        yield RENAMED[topic], time, message


def floor_height(folder: Path) -> float:
    """m, median height of the labelled points at most 0.3 m above or below the floor."""
    z = read_ply(folder / "semantic_map.ply")["z"]
    return float(np.median(z[np.abs(z) < 0.3]))


@pytest.mark.parametrize("images", ["32FC1", "16UC1"])
def test_the_pioneers_bags_are_mapped(images: ImageFormat, tmp_path: Path) -> None:
    convert([write_bag(tmp_path / "ros2", images, pioneer)], tmp_path / "rgbd_pioneer.bag", **TO_ROS_1)
    place = "--camera-pose", None, None, T_BASE_CAMERA[2, 3], None, TILT, None
    run(tmp_path / "rgbd_pioneer.bag", "--out", tmp_path / "out", "--labels", "rules", *place)
    notes = json.loads((tmp_path / "out" / "report.json").read_text())["recording"]["notes"]
    assert any("openni_camera" in note and "using laser" in note for note in notes)
    assert any("Kinect" in note for note in notes)
    assert abs(floor_height(tmp_path / "out")) < 0.02
    moves = [inverse(poses[0]) @ poses[-1] for poses in (estimated(tmp_path / "out"), WAY)]
    np.testing.assert_allclose(moves[0][:2, 3], moves[1][:2, 3], atol=0.05)


def estimated(folder: Path) -> np.ndarray:
    """(N, 4, 4) poses that a run wrote."""
    return read_trajectory(folder / "trajectory_estimated.tum", of_camera=False).poses


def test_wheels_alone_are_those_of_the_topic(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", change=pioneer, number=4)
    place = "--camera-pose", None, None, T_BASE_CAMERA[2, 3], None, TILT, None
    run(bag, "--out", tmp_path / "out", "--labels", "rules", "--poses", "odometry", *place)
    moves = [inverse(poses[0]) @ poses[-1] for poses in (estimated(tmp_path / "out"), ODOMETRY[:4])]
    np.testing.assert_allclose(moves[0], moves[1], atol=1e-5)


def test_what_is_not_given_of_the_cameras_pose_is_as_recorded(tmp_path: Path) -> None:
    config = MapRecordingConfig(path=write_bag(tmp_path / "bag", number=2), out=Path("out"))
    recorded = CameraPose.of(T_BASE_CAMERA)
    for numbers, expected in (
        ((None, None, 0.5, None, None, None), recorded._replace(z=0.5)),
        ((None, None, 0.5, None, -3.0, None), recorded._replace(z=0.5, pitch=-3.0)),
        ((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), CameraPose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    ):
        found = camera_pose(open_recording(config), replace(config, camera_pose=numbers))
        assert found is not None
        np.testing.assert_allclose(found, expected.T_base_camera, atol=1e-9)
    assert camera_pose(open_recording(config), config) is None


@pytest.mark.parametrize(
    ("kind", "numbers", "said"),
    [
        ("without", "None None 0.6 None None None", "--camera-pose None None 0.6 None None None: "),
        ("tum", "0 0 nan 0 0 0", "--camera-pose 0 0 nan 0 0 0: "),
    ],
)
def test_a_pose_that_cannot_be_completed_is_refused(
    kind: str, numbers: str, said: str, ways_in: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in failed(capsys, ways_in[kind], "--out", tmp_path / "out", "--camera-pose", *numbers.split())
    assert not (tmp_path / "out").exists()


@pytest.fixture
def far_sighted(tmp_path: Path) -> str:
    """The file of a robot whose camera measures depths from 0.4 to 6 m."""
    robot = tmp_path / "robot.xml"
    custom = '<custom><numeric name="depth_range" data="0.4 6"/>'
    robot.write_text(robot_file("jackal").read_text().replace("<custom>", custom, 1))
    return str(robot)


def test_the_robots_file_gives_the_range_of_a_camera_without_a_name(
    far_sighted: str, hall: Path, tmp_path: Path
) -> None:
    config = MapRecordingConfig(path=hall, out=tmp_path / "out", robot=far_sighted)
    recording = open_recording(config)
    set_sensor(recording, config)
    assert recording.sensor is not None
    assert (recording.sensor.nearest, recording.sensor.farthest) == (0.4, 6.0)
    assert any("0.4 to 6 m" in note for note in recording.notes)
    set_sensor(recording, replace(config, depth_range=(0.5, 4.0)))
    assert (recording.sensor.nearest, recording.sensor.farthest) == (0.5, 4.0)


@pytest.mark.parametrize(("name", "depths"), [("tum", (0.4, 6.0)), ("bag", (0.4, 6.0)), ("scene", (0.8, 3.5))])
def test_the_robots_file_gives_the_range_in_sarsims_own_recordings_but_scenes(
    name: str, depths: tuple[float, float], far_sighted: str, ways_in: dict[str, Path], tmp_path: Path
) -> None:
    config = MapRecordingConfig(path=ways_in[name], out=tmp_path / "out")
    recording = open_recording(config)
    set_sensor(recording, config)
    assert recording.sensor == XTION and not recording.notes
    set_sensor(recording, replace(config, robot=far_sighted))
    assert recording.sensor is not None
    assert (recording.sensor.nearest, recording.sensor.farthest) == depths
    assert any("0.4 to 6 m" in note for note in recording.notes) == (name != "scene")
