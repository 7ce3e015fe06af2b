"""What the pipeline logs, read back from the file."""

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.localisation.localisation import LocalisedFrame, Loop
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.mapper import Mapper
from pipeline.rerun.config import RerunConfig
from pipeline.rerun.recorder import Recorder
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw, wrap_angle
from tests.pipeline.rescue_report.people import block, victim
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import WALL, StillRobot
from tests.recordings import read

rr.set_strict_mode(True)  # otherwise a call with wrong arguments is a warning alone

STEPS = 3
EACH_STEP = {"world/robot/camera", "world/robot/camera/rgb", "world/robot/camera/depth"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """(explorer, steps, the file's rows) of a robot that takes three keyframes and moves after the first."""
    path = tmp_path_factory.mktemp("wall-0") / "episode.rrd"
    robot = StillRobot()
    explorer = Explorer(robot, Mapper(robot.model, TruthClassifier(), localisation=OdometryLocalisation()))
    steps = []
    recorder = Recorder(path)
    for index in range(STEPS):
        steps.append(explorer.step())
        recorder.on_step(explorer.mapper, steps[-1])
        if index == 0:
            for k in range(1, 51):
                robot.time = 0.04 * k
                recorder.log_pose(robot.time, from_yaw(0.008 * k, 0, 0, 0.01 * k))
    recorder.log_message("WARN", "nothing more to see")
    recorder.close()
    return explorer, steps, read(path)


def components(rows, name):
    """One array for every row that carries the component."""
    return [np.array(row[name]) for row in rows if row.get(name) is not None]


def test_the_timelines_are_step_and_sim_time(recording):
    _, _, rows = recording
    on = {timeline for found in rows.values() for row in found for timeline in row if ":" not in timeline}
    assert on == {"step", "sim_time"}


def test_every_entity_is_there(recording):
    _, _, rows = recording
    expected = {
        "world", "world/robot", *EACH_STEP, "world/robot/camera/labels", "world/metric_map/occupied",
        "world/metric_map/free", "world/semantic_map", "world/segments", "world/topological_map/nodes",
        "world/topological_map/edges", "world/path_plan", "world/frontiers", "world/trajectory/estimated", "log",
        "world/localisation/keyframes", "world/localisation/loops", "legend",
        "metrics/explored_area_m2", "metrics/distance_m", "metrics/speed_m_s", "metrics/roll_deg",
        "metrics/pitch_deg", "metrics/map/occupied_voxels", "metrics/time_ms/sense",
    }  # fmt: skip
    assert {f"/{entity}" for entity in expected} <= rows.keys()


def test_each_keyframe_is_a_step(recording):
    _, steps, rows = recording
    for entity in EACH_STEP:
        found = rows[f"/{entity}"]
        assert [row["step"] for row in found] == list(range(STEPS))
        times = [step.keyframe.frame.time for step in steps]
        assert [row["sim_time"] for row in found] == pytest.approx(times)


def test_z_is_up_and_labels_have_their_names_and_colours(recording):
    _, _, rows = recording
    world = rows["/world"][0]
    assert world["ViewCoordinates:xyz"] == [[3, 5, 1]]  # right, forward, up
    infos = [entry["class_description"]["info"] for entry in world["AnnotationContext:context"][0]]
    assert [(info["id"], info["label"]) for info in infos] == [(int(x), PLAIN_NAMES[x]) for x in Label]
    red, green, blue = COLOURS[Label.VICTIM].tolist()
    assert infos[Label.VICTIM]["color"] == red << 24 | green << 16 | blue << 8 | 255


def test_pictures_come_back_as_they_were(recording):
    _, steps, rows = recording
    camera = "/world/robot/camera"
    for index, frame in enumerate(step.keyframe.frame for step in steps):
        depth = components(rows[f"{camera}/depth"], "EncodedDepthImage:blob")[index]
        millimetres = cv2.imdecode(depth.astype(np.uint8).ravel(), cv2.IMREAD_UNCHANGED)
        np.testing.assert_allclose(millimetres / 1000, frame.depth, atol=0.5001e-3)
        rgb = components(rows[f"{camera}/rgb"], "EncodedImage:blob")[index]
        picture = cv2.imdecode(rgb.astype(np.uint8).ravel(), cv2.IMREAD_COLOR)[..., ::-1]
        assert np.abs(picture.astype(int) - frame.rgb).mean() < 3
        labels = components(rows[f"{camera}/labels"], "SegmentationImage:buffer")[index]
        np.testing.assert_array_equal(labels.reshape(frame.depth.shape), frame.label)


def test_the_camera_projects_as_its_intrinsics_say(recording):
    _, steps, rows = recording
    frame, row = steps[0].keyframe.frame, rows["/world/robot/camera"][0]
    k = frame.intrinsics
    columns = [[k.fx, 0, 0], [0, k.fy, 0], [k.cx, k.cy, 1]]
    np.testing.assert_allclose(np.reshape(row["Pinhole:image_from_camera"], (3, 3)), columns)
    np.testing.assert_allclose(row["Transform3D:translation"][0], frame.T_base_camera[:3, 3], atol=1e-6)
    matrix = np.reshape(row["Transform3D:mat3x3"], (3, 3)).T
    np.testing.assert_allclose(matrix, frame.T_base_camera[:3, :3], atol=1e-6)


def test_between_steps_the_robot_moves_in_sim_time_alone(recording):
    _, _, rows = recording
    moving = [row for row in rows["/world/robot"] if row.get("step") is None]
    # 25 poses a second for 2 s, thinned to five a second.
    assert [row["sim_time"] for row in moving] == pytest.approx(np.arange(0.04, 2, 0.2))
    x = [row["Transform3D:translation"][0][0] for row in moving]
    assert x == pytest.approx(0.2 * np.arange(0.04, 2, 0.2), abs=1e-6)


def test_distance_and_speed_are_those_driven(recording):
    _, _, rows = recording
    distance = np.array(components(rows["/metrics/distance_m"], "Scalars:scalars")).ravel()
    # 0.4 m in steps of 8 mm; the next step, from where the robot really stands, takes it back.
    assert distance.max() == pytest.approx(0.8)
    speed = np.array(components(rows["/metrics/speed_m_s"], "Scalars:scalars")).ravel()
    np.testing.assert_allclose(speed, 0.2)


def test_voxels_lie_where_the_map_has_them(recording):
    explorer, _, rows = recording
    last = rows["/world/metric_map/occupied"][-1]
    index, corner = np.array(last["VoxelGridMap:voxel_indices"]), np.array(last["VoxelGridMap:translation"])
    size = np.array(last["VoxelGridMap:voxel_size"])
    centres = (index + 0.5) * size + corner
    np.testing.assert_allclose(centres, explorer.mapper.metric_map.occupied_centres(), atol=1e-5)
    assert len(rows["/world/metric_map/free"][-1]["VoxelGridMap:voxel_indices"]) == len(
        explorer.mapper.metric_map.free_centres()
    )


def test_the_semantic_map_is_thinned_and_labelled(recording):
    explorer, _, rows = recording
    last = rows["/world/semantic_map"][-1]
    points, labels = np.array(last["Points3D:positions"]), np.array(last["Points3D:class_ids"])
    cubes = np.floor(explorer.mapper.semantic_map.points() / 0.04).astype(int)
    assert len(points) == len(np.unique(cubes, axis=0)) < len(explorer.mapper.semantic_map)
    assert set(labels) == {Label.WALL, Label.TERRAIN}
    np.testing.assert_allclose(points[labels == Label.WALL][:, 0], WALL, atol=1e-3)
    np.testing.assert_allclose(points[labels == Label.TERRAIN][:, 2], 0, atol=1e-3)


def test_clouds_are_logged_when_they_have_grown_and_at_the_end(recording):
    _, _, rows = recording
    # The second and third keyframes show nothing new.
    assert [row["step"] for row in rows["/world/semantic_map"]] == [0, STEPS - 1]
    assert [row["step"] for row in rows["/world/metric_map/free"]] == [0, STEPS - 1]


def test_segments_are_boxes_of_their_label(recording):
    explorer, _, rows = recording
    last = rows["/world/segments"][-1]
    assert last["Boxes3D:class_ids"] == [int(segment.label) for segment in explorer.mapper.segments]
    wall = last["Boxes3D:class_ids"].index(Label.WALL)
    assert last["Boxes3D:centers"][wall][0] == pytest.approx(WALL, abs=0.02)
    assert sorted(last["Boxes3D:half_sizes"][wall])[0] < 0.05


def test_the_plan_begins_at_the_robot_and_ends_at_the_viewpoint(recording):
    _, steps, rows = recording
    planned = [(step, row) for step, row in zip(steps, rows["/world/path_plan"], strict=True) if step.plan]
    assert planned
    for step, row in planned:
        way, heading = (np.array(strip) for strip in row["LineStrips3D:strips"])
        np.testing.assert_allclose(way[0, :2], step.keyframe.T_map_base[:2, 3], atol=1e-6)
        np.testing.assert_allclose(way[-1, :2], step.viewpoint.position, atol=1e-6)
        ahead = np.arctan2(*(heading[1] - heading[0])[[1, 0]])
        assert wrap_angle(ahead - step.viewpoint.heading) == pytest.approx(0, abs=1e-5)


def test_messages_have_a_level(recording):
    _, _, rows = recording
    assert [(row["TextLog:level"], row["TextLog:text"]) for row in rows["/log"]] == [
        (["WARN"], ["nothing more to see"])
    ]


def test_the_recording_brings_its_layout_and_bears_its_folders_name(tmp_path):
    path = tmp_path / "maze-7" / "episode.rrd"
    path.parent.mkdir()
    Recorder(path).close()
    reader = RrdReader(path)
    assert len(reader.blueprints()) == 1
    properties = {name: value for row in read(path)["/__properties"] for name, value in row.items()}
    assert properties["RecordingInfo:name"] == ["maze-7"]


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_recording_that_was_cut_off_can_be_read_and_needed_no_simulator(tmp_path):
    path = tmp_path / "episode.rrd"
    killed = """
import os, sys
from pathlib import Path
from pipeline.rerun.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]))
recorder.log_message("INFO", "before")
assert not {"mujoco", "dm_control", "sarsim"} & set(sys.modules)
recorder.stream.flush()
os.kill(os.getpid(), 9)
"""
    done = subprocess.run([sys.executable, "-c", killed, str(path)])
    assert done.returncode == -9
    assert read(path)["/log"][0]["TextLog:text"] == ["before"]


def test_a_file_that_cannot_be_written_is_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"missing/episode\.rrd"):
        Recorder(tmp_path / "missing" / "episode.rrd")


def pose(x=0.0, y=0.0, yaw=0.0):
    """4×4 of a level body."""
    return from_yaw(x, y, 0.0, yaw)


class Blind:
    """A detector that finds nobody."""

    def detect(self, rgb):
        return []


def be_elsewhere(explorer, T):
    """Make the localisation move all its poses, from now on, by a 4×4 transform in ``map``."""
    localisation = explorer.mapper.localisation
    localisation.restore(replace(localisation.keyframes(), poses=T @ localisation.poses))
    localisation.T_map_odom = T @ localisation.T_map_odom


@pytest.fixture(scope="module")
def corrected(tmp_path_factory):
    """(explorer, rows) of a robot whose poses are corrected after two of its three steps, and again at the end."""
    path = tmp_path_factory.mktemp("wall-1") / "episode.rrd"
    explorer = Explorer(
        StillRobot(), Mapper(PIONEER, TruthClassifier(), detector=Blind(), localisation=OdometryLocalisation())
    )
    recorder = Recorder(path)
    explorer.watch(recorder)
    for index in range(STEPS):
        if index == 1:
            person = victim(block((1.6, 0.3, 0.2), (0.3, 0.4, 0.5)))
            explorer.mapper.victims.all = [person]
        if index == 2:
            be_elsewhere(explorer, pose(0.2))
            explorer.mapper.localisation.loops.append(Loop(0, 1, np.eye(4)))
        explorer.step()
    be_elsewhere(explorer, pose(0, 0.3))
    explorer.apply_corrections()
    recorder.close()
    return explorer, read(path)


def test_a_correction_is_logged(corrected):
    _, rows = corrected
    first, second = (row["TextLog:text"][0] for row in rows["/log"])
    assert first.startswith("2 of 2 keyframes moved by up to 0.200 m and 0.0°")
    assert second.startswith("3 of 3 keyframes moved by up to 0.300 m and 0.0°")
    sizes = components(rows["/metrics/localisation/correction_m"], "Scalars:scalars")
    np.testing.assert_allclose(np.ravel(sizes), [0.2, 0.3])


@pytest.mark.parametrize(
    ("entity", "component"),
    [
        ("semantic_map", "Points3D:positions"),
        ("segments", "Boxes3D:centers"),
        ("victims", "Boxes3D:centers"),
        ("localisation/keyframes", "Arrows3D:origins"),
    ],
)
def test_what_was_corrected_is_logged_where_it_is_now(corrected, entity, component):
    _, rows = corrected
    before, *_, last = (np.array(row[component]).mean(axis=0) for row in rows[f"/world/{entity}"] if row[component])
    assert [row["step"] for row in rows[f"/world/{entity}"]][-2:] == [2, 2]
    # Boxes may be joined meanwhile, which moves their mean.
    np.testing.assert_allclose(last[:2] - before[:2], [0.2, 0.3], atol=0.06)


def test_after_a_correction_the_nodes_are_logged_as_they_are_now(corrected):
    explorer, rows = corrected
    logged = np.array(rows["/world/topological_map/nodes"][-1]["Points3D:positions"])
    nodes = np.array([node.position for node in explorer.mapper.topological_map.nodes.values()])
    np.testing.assert_allclose(logged[:, :2], nodes[:, :2], atol=1e-5)


def test_clouds_are_logged_anew_once_corrections_add_up_to_what_can_be_seen(tmp_path):
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation()))
    recorder = Recorder(tmp_path / "episode.rrd")
    explorer.watch(recorder)
    explorer.step()
    for _ in range(2):
        be_elsewhere(explorer, pose(0.6 * RerunConfig().point_spacing))
        explorer.step()
    recorder.close()
    rows = read(tmp_path / "episode.rrd")
    assert [row["step"] for row in rows["/world/semantic_map"]] == [0, 2, 2]  # and at the end
    assert [row["step"] for row in rows["/world/localisation/keyframes"]][:3] == [0, 1, 2]


def test_corrected_voxels_are_logged_even_if_they_are_as_many_as_before(corrected):
    explorer, rows = corrected
    for name in ("occupied", "free"):
        found = rows[f"/world/metric_map/{name}"]
        assert [row["step"] for row in found] == [0, 2, 2]
        last = found[-1]
        centres = (np.array(last["VoxelGridMap:voxel_indices"]) + 0.5) * np.array(last["VoxelGridMap:voxel_size"])
        centres += np.array(last["VoxelGridMap:translation"])
        np.testing.assert_allclose(centres, getattr(explorer.mapper.metric_map, f"{name}_centres")(), atol=1e-5)


def test_loops_join_their_keyframes(corrected):
    explorer, rows = corrected
    row = rows["/world/localisation/loops"][-1]
    ends = np.array(row["LineStrips3D:strips"][0])
    np.testing.assert_allclose(ends[:, :2], explorer.mapper.keyframes.poses[[0, 1], :2, 3], atol=1e-6)
    assert row["LineStrips3D:labels"] == ["loop closure between keyframes 1 and 0"]
    assert np.ravel(components(rows["/metrics/localisation/loops"], "Scalars:scalars")).tolist() == [0, 0, 1, 1]


def test_a_correction_moves_the_robot_and_its_way_but_drives_nowhere(corrected):
    _, rows = corrected
    places = [row["Transform3D:translation"][0] for row in rows["/world/robot"]]
    np.testing.assert_allclose(places[0], [0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(places[-1], [0.2, 0.3, 0], atol=1e-6)
    way = np.array(rows["/world/trajectory/estimated"][-1]["LineStrips3D:strips"][0])
    np.testing.assert_allclose(way, [[0.2, 0.3, 0.08]] * 2, atol=1e-6)
    assert max(np.ravel(components(rows["/metrics/distance_m"], "Scalars:scalars"))) == 0


def test_between_steps_the_newest_keyframe_says_where_the_odometry_is(tmp_path):
    robot = StillRobot()
    explorer = Explorer(robot, Mapper(robot.model, TruthClassifier(), localisation=OdometryLocalisation()))
    recorder = Recorder(tmp_path / "episode.rrd")
    recorder.on_step(explorer.mapper, explorer.step())
    recorder.log_pose(0.2, pose(1))
    be_elsewhere(explorer, pose(yaw=np.pi / 2))
    explorer.mapper.add_frame(LocalisedFrame(robot.sense(), explorer.mapper.localisation.poses[-1]), labelled=False)
    recorder.log_pose(0.4, pose(1))
    np.testing.assert_allclose(recorder.T_map_base, pose(yaw=np.pi / 2) @ pose(1))
    recorder.close()
    rows = read(tmp_path / "episode.rrd")
    moving = [row["Transform3D:translation"][0][:2] for row in rows["/world/robot"] if row.get("step") is None]
    np.testing.assert_allclose(moving, [[1, 0], [0, 1]], atol=1e-6)
    # The keyframe that was taken meanwhile is there at once.
    found = {(row.get("step"), len(row["Arrows3D:origins"])) for row in rows["/world/localisation/keyframes"]}
    assert found == {(0, 1), (None, 2), (0, 2)}


def test_stages_that_did_not_run_have_no_time(corrected):
    _, rows = corrected
    assert [row["step"] for row in rows["/metrics/time_ms/correction"]] == [2]
    assert [row["step"] for row in rows["/metrics/time_ms/sense"]] == [0, 1, 2]


def test_a_full_disk_is_one_line(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path / "episode.rrd")

    def flush(**_: float) -> None:
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr(recorder.stream, "flush", flush)
    with pytest.raises(InputError, match=r"episode\.rrd"):
        recorder.close()


def test_of_two_poses_at_one_time_the_first_is_logged(tmp_path):
    recorder = Recorder(tmp_path / "episode.rrd", config=RerunConfig(motion_period=0.0))
    assert recorder.log_pose(0.2, np.eye(4))
    assert not recorder.log_pose(0.2, from_yaw(0.1, 0, 0, 0))
    assert recorder.log_pose(0.2001, from_yaw(0.1, 0, 0, 0))
    recorder.close()
