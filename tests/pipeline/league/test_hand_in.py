"""A run's files become a mission's."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.files import whole_file
from pipeline.league.cloud import read_cloud
from pipeline.league.hand_in import hand_in, league_frame
from pipeline.league.pois import read_pois
from pipeline.league.validation import validate
from pipeline.map_file import save_maps
from pipeline.mapper import Mapper
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw, transform_points
from tests.pipeline.league.handed_in_room import BRIEF
from tests.pipeline.polygon_scene import floor, look, pose, wall
from tests.pipeline.robot_model import PIONEER

STEP = "{:.2f} {:.3f} 0 0 0 0 0 1\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a robot that looked along x from the origin at a wall 2.2 m away, and found a sign."""
    folder, mapper = tmp_path_factory.mktemp("run"), Mapper(PIONEER, TruthClassifier())
    T_base_camera = pose(0.1, 0, 0.65, 0, 0.3)
    frame = look([floor(-2, 6, -3, 3), wall((2.2, 2.3), (2.2, -2.3))], T_base_camera, 0.0, 0)
    frame = replace(frame, T_base_camera=T_base_camera, T_odom_base=np.eye(4))
    mapper.assume_ground(np.eye(4))
    mapper.add(frame, mapper.localise(frame))
    save_maps(mapper, folder)
    with whole_file(folder / "trajectory_estimated.tum") as file:
        file.write_text("".join(STEP.format(t, 0.1 * t) for t in range(5)))
    find = '{"kind": "hazmat_sign", "text": "poison", "position": [2.2, 0.5, 0.6], "time_s": 61.0, "confidence": 0.9}'
    (folder / "finds.json").write_text(f"[{find}]")
    return folder


@pytest.fixture(scope="module")
def files(run):
    return hand_in(run, BRIEF, PIONEER)


def test_a_judge_rejects_nothing(run, files):
    assert [file.parent for file in files] == [run / "handed_in"] * 3
    assert validate(run) == []


def test_the_origin_is_at_the_robots_front_and_it_looks_along_y(files):
    points = read_cloud(files[1]).points()
    is_wall = points[:, 2] > 0.2
    np.testing.assert_allclose(np.median(points[is_wall, 1]), 2.2 - PIONEER.half_length, atol=0.01)
    np.testing.assert_allclose(np.median(points[~is_wall & (points[:, 1] < 1.5), 2]), 0, atol=0.01)
    (poi,) = read_pois(files[2]).pois
    np.testing.assert_allclose(poi.position, [-0.5, 2.2 - PIONEER.half_length, 0.6], atol=0.0051)
    assert poi.time == "14:31:01"


def test_files_are_equal_by_run(run, files):
    before = [file.read_bytes() for file in files]
    assert [file.read_bytes() for file in hand_in(run, BRIEF, PIONEER)] == before


def test_the_frame_of_a_turned_robot():
    T = league_frame(from_yaw(1, 2, 0.5, np.pi / 2), 0.25)
    np.testing.assert_allclose(
        transform_points(T, np.array([(0.0, 0, 0), (0, 1, 0), (1, 0, 0)])),
        [(1, 2.25, 0.5), (1, 3.25, 0.5), (2, 2.25, 0.5)],
        atol=1e-6,
    )


def test_what_can_be_written_is(run, files, tmp_path):
    for name in ("metric_map.npz", "trajectory_estimated.tum", "finds.json"):
        (tmp_path / name).write_bytes((run / name).read_bytes())
    with pytest.raises(InputError, match=r"keyframes\.npz"):
        hand_in(tmp_path, BRIEF, PIONEER)
    assert sorted(path.suffix for path in (tmp_path / "handed_in").iterdir()) == [".csv", ".ply"]


def test_a_run_without_a_pose_is_refused(tmp_path):
    (tmp_path / "trajectory_estimated.tum").write_text("")
    with pytest.raises(InputError, match=r"trajectory_estimated\.tum"):
        hand_in(tmp_path, BRIEF, PIONEER)
