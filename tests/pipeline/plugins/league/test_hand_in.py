"""What a run knows at its end becomes a mission's files."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.plugins.league.cloud import read_cloud
from pipeline.plugins.league.hand_in import LeagueFiles, hand_in, league_frame
from pipeline.plugins.league.pois import read_pois
from pipeline.plugins.league.validation import validate
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.sink import Result
from pipeline.tracks.finds import Finds
from pipeline.transforms import from_yaw, transform_points
from tests.pipeline.plugins.league.handed_in_room import BRIEF, found
from tests.pipeline.polygon_scene import floor, look, pose, wall
from tests.pipeline.robot_model import PIONEER

DRIVEN = np.array([from_yaw(0.1 * k, 0, 0, 0) for k in range(5)])
SIGN = found("hazmat_sign", "poison", [2.2, 0.5, 0.6], 61.0, 0.9)


def look_ahead(mapper, time=0.0):
    """Let a mapper take the frame of a robot that looks along x from the origin at a wall 2.2 m away."""
    T_base_camera = pose(0.1, 0, 0.65, 0, 0.3)
    frame = look([floor(-2, 6, -3, 3), wall((2.2, 2.3), (2.2, -2.3))], T_base_camera, 0.0, 0)
    frame = replace(frame, time=time, T_base_camera=T_base_camera, T_odom_base=np.eye(4))
    mapper.add_frame(mapper.localise(frame), set_down=True)
    return frame


@pytest.fixture(scope="module")
def mapper():
    mapper = Mapper(PIONEER, TruthClassifier())
    look_ahead(mapper)
    return mapper


def handed_in(folder, mapper):
    return hand_in(folder, BRIEF, DRIVEN, [SIGN], mapper.metric_map, mapper.semantic_map, mapper.traversability)


@pytest.fixture(scope="module")
def files(mapper, tmp_path_factory):
    return handed_in(tmp_path_factory.mktemp("run"), mapper)


def test_a_judge_rejects_nothing(files):
    folder = files[0].parent
    assert folder.name == "handed_in" and {file.parent for file in files} == {folder}
    assert validate(folder.parent) == []


def test_the_origin_is_at_the_robots_front_and_it_looks_along_y(files):
    points = read_cloud(files[1]).rows()
    is_wall = points[:, 2] > 0.2
    np.testing.assert_allclose(np.median(points[is_wall, 1]), 2.2 - PIONEER.half_length, atol=0.01)
    np.testing.assert_allclose(np.median(points[~is_wall & (points[:, 1] < 1.5), 2]), 0, atol=0.01)
    (poi,) = read_pois(files[2]).pois
    np.testing.assert_allclose(poi.position, [-0.5, 2.2 - PIONEER.half_length, 0.6], atol=0.0051)
    assert poi.time == "14:31:01"


def test_files_are_equal_by_run(mapper, files, tmp_path):
    assert [file.read_bytes() for file in handed_in(tmp_path, mapper)] == [file.read_bytes() for file in files]


def test_the_frame_of_a_turned_robot():
    T = league_frame(from_yaw(1, 2, 0.5, np.pi / 2), 0.25)
    np.testing.assert_allclose(
        transform_points(T, np.array([(0.0, 0, 0), (0, 1, 0), (1, 0, 0)])),
        [(1, 2.25, 0.5), (1, 3.25, 0.5), (2, 2.25, 0.5)],
        atol=1e-6,
    )


def test_what_can_be_written_is(mapper, tmp_path):
    in_the_way = tmp_path / "handed_in" / BRIEF.map_2d_name
    in_the_way.mkdir(parents=True)
    with pytest.raises(InputError, match=BRIEF.map_2d_name):
        handed_in(tmp_path, mapper)
    assert {path.suffix for path in in_the_way.parent.iterdir() if path.is_file()} == {".csv", ".ply"}


def test_a_robot_that_never_moved_hands_in_what_it_found_since_its_run_began(tmp_path, monkeypatch):
    mapper, begin = Mapper(PIONEER, TruthClassifier()), 1.7e9
    trajectory = EstimatedTrajectory(mapper.localisation, [])
    trajectory.add(look_ahead(mapper, begin))
    monkeypatch.setattr(Finds, "reported", [replace(SIGN, time_s=begin + 61)])
    LeagueFiles(BRIEF).finish(Result(tmp_path, mapper, trajectory, 1, 0.0, 0.0))
    assert {path.suffix for path in (tmp_path / "handed_in").iterdir()} == {".csv", ".ply", ".tiff"}
    (poi,) = read_pois(tmp_path / "handed_in" / BRIEF.pois_name).pois
    assert poi.time == "14:31:01"
