"""Walls of a room of 4 × 4 m, looked at until all can be read."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.elevation_map.config import ElevationConfig
from pipeline.exploration.viewpoint import Context
from pipeline.keyframes import KeyframeObservation
from pipeline.localisation.localisation import LocalisedFrame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.mapper import Mapper
from pipeline.planning.pose_paths import PosePaths
from pipeline.plugins.league.config import InspectionConfig
from pipeline.plugins.league.inspection import Inspection, WallPieces
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw, yaw_of
from tests.pipeline.polygon_scene import CAMERA, floor, look, pose, wall
from tests.pipeline.robot_model import PIONEER

T_BASE_CAMERA = pose(0.1, 0, 0.65, 0, 0.1)
CORNERS = [(-2, -2), (2, -2), (2, 2), (-2, 2)]
ROOM = [floor(-2, 2, -2, 2), *(wall(b, a) for a, b in zip(CORNERS, CORNERS[1:] + CORNERS[:1], strict=True))]
MAX_LOOKS = 40
READABLE = 60  # pixels


def frame_at(T):
    return replace(look(ROOM, T @ T_BASE_CAMERA, 0.002), T_base_camera=T_BASE_CAMERA, T_odom_base=T)


def test_pieces_of_a_wall_lie_on_it_with_how_large_a_sign_was():
    frame = frame_at(from_yaw(0.5, 0, 0, 0))  # the camera is 1.4 m before a wall
    points, config = frame.points(frame.T_base_camera), ElevationConfig()
    seen = KeyframeObservation.of(frame, points, None, 4, 0.05, config, PIONEER)
    found = WallPieces.of(seen, frame, InspectionConfig())
    ahead = found.where(np.abs(found.points[:, 1]) < 0.1)
    assert len(ahead.points) >= 10
    assert ahead.points[:, 0] == pytest.approx(1.5, abs=0.01)
    assert ahead.normals @ [-1, 0, 0] == pytest.approx(1, abs=0.02)
    level = ahead.where(np.abs(ahead.points[:, 2] - 0.65) < 0.1)
    assert level.sign_widths == pytest.approx(CAMERA.fx * 0.2 / 1.4, rel=0.03)
    assert (found.points[:, 2] > 0.01).all()  # none is of the floor
    assert (found.sign_widths_from([(3.0, 0.0, 0.65)], frame) == 0).any()  # from behind the wall


def inspection_with(mapper: Mapper) -> Inspection:
    numbers = mapper.config.exploration
    return Inspection(mapper.keyframes, mapper.metric_map, config=numbers, walls=InspectionConfig())


def test_a_robot_looks_until_every_wall_was_seen_well_and_then_ends():
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    inspection, T, looked = inspection_with(mapper), from_yaw(0, 0, 0, 0), []
    for yaw in np.arange(8) * np.pi / 4:  # what exploring shows, from the middle
        around = from_yaw(0, 0, 0, yaw)
        mapper.add_frame(LocalisedFrame(frame_at(around), around), labelled=False, set_down=not yaw)
    while len(looked) < MAX_LOOKS:
        frame = frame_at(T)
        mapper.add_frame(LocalisedFrame(frame, T), labelled=False)
        paths = PosePaths(mapper.traversability, T[:2, 3], yaw_of(T))
        context = Context(frame, T, mapper.elevation_map.measured, paths, mapper.keyframes.poses)
        inspection.observe(context)
        if (viewpoint := inspection.next_viewpoint(context)) is None:
            break
        inspection.commit(viewpoint, context)
        T = from_yaw(*viewpoint.position, 0, viewpoint.heading)
        looked.append(T)
    assert 4 <= len(looked) < MAX_LOOKS  # from the middle no wall is near enough
    cameras = np.array([T @ T_BASE_CAMERA for T in looked])
    for x, y in [(2, 0), (0, 2), (-2, 0), (0, -2), (2, 1), (-1, -2)]:
        way = np.array([x, y, 0.65]) - cameras[:, :3, 3]
        away = np.linalg.norm(way, axis=1)
        cosine = np.abs(way[:, 0] if abs(x) == 2 else way[:, 1]) / away
        in_view = np.einsum("ni,ni->n", way, cameras[:, :3, 2]) / away > np.cos(np.arctan2(320, 577))
        assert (in_view & (CAMERA.fx * 0.2 * cosine / away > 0.9 * READABLE)).any(), (x, y)
